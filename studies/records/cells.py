"""Size of cells: bodies roll and slide down an inclined plane, for which closed forms say how, on cells of several
sizes and across a seam."""

import math
from dataclasses import replace
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros import BodyState, Box, HeightMap, Sphere
from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.engines.engine import Engine, EngineBody, Setup
from studies.engines.smartmesh import SmartMesh
from studies.pages import number, table
from studies.records.entrants import OURS, RATE, enter, entrants

FRICTION = 0.2
# The plane falls along no axis of the map: its tilt, and the direction in which it falls, from x to y [rad].
TILT, COURSE = math.radians(15.0), 0.5
EXTENT, CELLS = 8.0, (0.025, 0.05, 0.1, 0.2)  # of the map, and its resolutions [m]
SECONDS, SETTLE = 1.0, 0.25
SHAPES: dict[str, Any] = {"balls": Sphere(0.2), "boxes": Box(0.4, 0.3, 0.2)}
COUNT = 9
# Bodies start around the middle of the map; a second map joins the first where x is this [m], and all cross it.
MIDDLE = 0.5 * EXTENT
SEAM = MIDDLE - 0.4

_FALL = np.array([math.cos(COURSE), math.sin(COURSE)])
NORMAL = np.array([*(math.sin(TILT) * _FALL), math.cos(TILT)])
DOWN = np.array([*(math.cos(TILT) * _FALL), -math.sin(TILT)])


class Figures(NamedTuple):
    """Of bodies after they settled: the deepest below the plane [mm], root mean square of the force that is not as it
    should be [% of the weight], and processor time of a step [us]."""

    depth: float
    force: float
    cost: float


def heights_at(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the heights [m] of the plane at ``x`` and ``y`` [m]."""
    return np.asarray(-math.tan(TILT) * (_FALL[0] * (x - MIDDLE) + _FALL[1] * (y - MIDDLE)))


def acceleration(kind: str) -> float:
    """Return the acceleration down the plane [m/s^2]: balls roll, boxes slide."""
    if kind == "balls":
        return 5.0 / 7.0 * GRAVITY * math.sin(TILT)
    return GRAVITY * (math.sin(TILT) - FRICTION * math.cos(TILT))


def bodies_of(kind: str) -> list[EngineBody]:
    """Return bodies that lie on the plane, above the seam."""
    shape, half = SHAPES[kind], 0.5 * TILT
    axis = np.array([-_FALL[1], _FALL[0], 0.0])  # about which it falls
    orientation = (*(math.sin(half) * axis), math.cos(half))
    lift = shape.radius if kind == "balls" else 0.5 * shape.z
    found = []
    for k in range(COUNT):
        x, y = MIDDLE - 0.9 + 0.011 * k, MIDDLE + 0.7 * (k - 0.5 * (COUNT - 1)) + 0.013 * k
        centre = np.array([x, y, float(heights_at(np.array(x), np.array(y)))]) + lift * NORMAL
        found.append(EngineBody(shape=shape, state=BodyState(tuple(centre), orientation), friction=FRICTION))
    return found


def lowest(kind: str, poses: FloatArray) -> FloatArray:
    """Return how far the lowest point of each body (N,) is above the plane [m]."""
    shape, above = SHAPES[kind], (poses[:, :3] - (MIDDLE, MIDDLE, 0.0)) @ NORMAL
    if kind == "balls":
        return np.asarray(above - shape.radius)
    edges = rotated(poses[:, None, 3:], np.diag([shape.x, shape.y, shape.z]))
    return np.asarray(above - 0.5 * np.abs(edges @ NORMAL).sum(axis=1))


def run(engine: Engine, kind: str) -> Figures:
    """Let the bodies roll or slide, and measure."""
    wanted, spent, depths, forces = acceleration(kind) * DOWN, 0.0, [], []
    settle, steps = round(SETTLE * RATE), round(SECONDS * RATE)
    for step in range(steps):
        before = engine.velocities()[:, :3]
        begun = process_time()
        engine.step()
        spent += (process_time() - begun) * (step >= settle)
        if step >= settle:
            missed = (engine.velocities()[:, :3] - before) * RATE - wanted
            forces.append(np.sum(missed**2, axis=1) / GRAVITY**2)
            depths.append(-lowest(kind, engine.poses()).min())
    return Figures(1e3 * max(depths), 100.0 * math.sqrt(np.mean(forces)), spent / (steps - settle) * 1e6)


def setup_of(kind: str, cell: float) -> Setup:
    """Return the bodies on the plane, sampled with a resolution of ``cell`` [m]."""
    along = cell * np.arange(round(EXTENT / cell) + 1, dtype=np.float64)
    heights = heights_at(along[None, :], along[:, None])
    return Setup(heights=heights, resolution=cell, dt=1.0 / RATE, bodies=bodies_of(kind))


def across_seam(kind: str, fine: float, coarse: float) -> Figures:
    """Return our figures where bodies cross from a map with ``fine`` cells to one with ``coarse`` cells [m]."""
    setup = setup_of(kind, fine)
    left = replace(setup, heights=setup.heights[:, : round(SEAM / fine) + 1])
    rest = setup_of(kind, coarse).heights[:, round(SEAM / coarse) :]
    second = HeightMap(rest, resolution=coarse, origin=(SEAM, 0.0))
    with SmartMesh(left) as engine:
        engine.world.terrain.put("second", second)
        return run(engine, kind)


def cells_table() -> tuple[str, dict[str, dict[str, dict[str, Figures]]]]:
    """Return the table, and the figures by kind, engine and resolution."""
    found: dict[str, dict[str, dict[str, Figures]]] = {}
    rows = []
    for kind in SHAPES:
        found[kind] = {}
        for name in entrants():
            figures = found[kind][name] = {}
            for cell in CELLS:
                with enter(name, setup_of(kind, cell)) as engine:
                    figures[f"{100 * cell:g} cm"] = run(engine, kind)
        found[kind][OURS]["seam, 5 to 20 cm"] = across_seam(kind, 0.05, 0.2)
        for name, figures in found[kind].items():
            for cells, one in figures.items():
                rows.append([f"{kind}: {name}", cells, *(number(round(value, 4)) for value in one)])
    return table(["bodies: engine", "cells", "deepest [mm]", "force off [%]", "step [us]"], rows), found
