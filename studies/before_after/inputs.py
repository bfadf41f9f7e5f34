"""Inputs of both sides, made once: maps, initial positions, and the surface for measurements."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from smartmesh_ros.evaluation.clearance import clearances
from smartmesh_ros.evaluation.distance import Surface
from smartmesh_ros.evaluation.grounds import make_ground
from smartmesh_ros.evaluation.measures import Penetration, penetration
from smartmesh_ros.terrain.grid import FloatArray
from studies.before_after.case import PHYSICS_RATE, Case
from studies.matrix.arena import square

# Bodies start within this share of the map [-].
SPREAD = 0.85


def write_inputs(case: Case, folder: Path) -> None:
    """Writes the case, its maps (M, R, C) [m] and where its bodies start (N, 3) [m] into a new folder."""
    folder.mkdir()
    settings = {**asdict(case), "rate": PHYSICS_RATE, "origin": square(case.samples, case.resolution).origin}
    (folder / "case.json").write_text(json.dumps(settings))
    np.save(folder / "maps.npy", _maps(case))
    np.save(folder / "starts.npy", _starts(case))


def _maps(case: Case) -> FloatArray:
    ground = make_ground(square(case.samples, case.resolution), **case.ground)
    moves = case.ground["kind"] == "waves"
    count = int(case.seconds * case.map_rate) + 2 if moves else 1
    return np.stack([ground.heights(index / case.map_rate if case.map_rate else 0.0) for index in range(count)])


def _starts(case: Case) -> FloatArray:
    """Places apart from one another by the bodies' size, a little above the ground."""
    geometry = square(case.samples, case.resolution)
    surface = Surface(geometry, np.asarray(make_ground(geometry, **case.ground).heights(0.0), np.float64))
    radius = case.make_shape().bounding_radius
    half = -geometry.origin[0]
    rng = np.random.default_rng(case.seed)
    places: list[FloatArray] = []
    while len(places) < case.count:
        place = rng.uniform(-SPREAD, SPREAD, 2) * half
        if all(np.hypot(*(place - other)) > 2.2 * radius for other in places):
            places.append(place)
    points = np.column_stack([np.array(places), np.zeros(case.count)])
    points[:, 2] = surface.below(points) + 1.1 * radius
    return points


def measure(case: Case, times: FloatArray, positions: FloatArray, orientations: FloatArray) -> Penetration:
    """Penetration at T instants ``times`` (T,) [s] of N bodies at ``positions`` (T, N, 3) [m]."""
    geometry = square(case.samples, case.resolution)
    ground = make_ground(geometry, **case.ground)
    clearance = np.empty(positions.shape[:2])
    below = np.zeros(positions.shape[:2], bool)
    for index, time in enumerate(times.tolist()):
        surface = Surface(geometry, np.asarray(ground.heights(time), np.float64))
        level = surface.below(positions[index])
        clearance[index] = clearances(surface, case.make_shape(), positions[index], orientations[index])
        clearance[index, np.isnan(level)] = np.nan
        below[index] = positions[index, :, 2] < level
    return penetration(clearance, below, np.zeros(below.shape, bool))
