"""How bodies move in each engine: on an inclined plane with cells of several sizes, where closed forms say how they
roll and slide; and a ball on a deck that heaves, which it should leave with e times the speed (Newton)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros import BodyState, Box, HeightMap, PhysicsConfig, Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.clearance import rotate
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.chart import COLOURS
from studies.engines.engine import Engine, EngineBody, GroundSetup, Setup, build, missing
from studies.engines.smartmesh import SmartMesh
from studies.pages import number, table

RATE = 240  # of physics [Hz]
# Engine, options and colour by the name in tables. MuJoCo has its own default contacts, and the stiffest that it takes.
# Bodies are awake all the time: those that sleep cost nothing anywhere.
ENTRANTS: Mapping[str, tuple[str, Mapping[str, Any], str]] = {
    "smartmesh_ros": ("smartmesh", {"physics": PhysicsConfig(sleep=False)}, COLOURS["ours"]),
    "PyBullet": ("bullet_heightfield", {}, COLOURS["whole map"]),
    "MuJoCo": ("mujoco", {"time_constant": 0.02}, "#8fbfe0"),
    "MuJoCo, stiff": ("mujoco", {}, COLOURS["MuJoCo"]),
    "PhysX": ("physx", {}, COLOURS["PhysX"]),
    "Rapier": ("rapier", {}, COLOURS["Rapier"]),
}
OURS = "smartmesh_ros"


def entrants() -> list[str]:
    """Return the names of the engines that are installed."""
    return [name for name, (engine, *_) in ENTRANTS.items() if not missing(engine)]


def enter(name: str, setup: GroundSetup) -> Engine:
    """Return a scene in an engine. The plane of our bodies is PyBullet's."""
    engine, options, _ = ENTRANTS["PyBullet" if setup.plane and name == OURS else name]
    found: Engine = build(engine, setup, **options)
    return found


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
    edges = rotate(poses[:, 3:], np.diag([shape.x, shape.y, shape.z]))
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


HEAVE, FREQUENCY = 0.2, math.pi  # amplitude [m] and angular frequency [rad/s] of the deck: up to 0.63 m/s
FALL = 0.3  # from release to touchdown [s]: 2.9 m/s
RESTITUTIONS, PHASES = (0.3, 0.6, 0.9), 8
BALL = Sphere(0.2)
SIDE, CELL = 21, 0.25
DT = 1.0 / RATE
PATIENCE = 0.2  # how long we wait for the ball to leave the deck [s]


def rebound(name: str, restitution: float, phase: float | None) -> float:
    """Return the share of the relative speed that a ball leaves a deck with, zero if it stays. ``phase`` [rad]: of the
    deck at touchdown, None = it is at rest. A map comes in every step."""
    heave = 0.0 if phase is None else HEAVE

    def height(time: float) -> float:
        return heave * math.sin(FREQUENCY * (time - FALL) + (phase or 0.0))

    middle, start = 0.5 * CELL * (SIDE - 1), height(FALL) + BALL.radius + 0.5 * GRAVITY * FALL**2
    body = EngineBody(shape=BALL, state=BodyState((middle + 0.03, middle + 0.02, start)), restitution=restitution)
    level = np.ones((SIDE, SIDE))
    setup = Setup(heights=height(0.0) * level, resolution=CELL, dt=DT, bodies=[body])
    with enter(name, setup) as engine:
        closing = 0.0
        for step in range(round((FALL + PATIENCE) / DT)):
            time = step * DT
            engine.set_ground(engine.ready(height(time) * level))
            gap, before = engine.positions()[0, 2] - BALL.radius - height(time), engine.velocities()[0, 2]
            engine.step()
            free = abs((engine.velocities()[0, 2] - before) / DT + GRAVITY) < 0.01 * GRAVITY
            if not closing and not free:
                closing = -speed_at_deck(height, time, gap, before)
            elif closing and free and before > (height(time + DT) - height(time - DT)) / (2.0 * DT):
                return speed_at_deck(height, time, gap, before) / closing
    return 0.0


def speed_at_deck(height: Callable[[float], float], time: float, gap: float, speed: float) -> float:
    """Return the speed [m/s] relative to a deck at ``height`` [m] where the parabola of a ball meets it that is a
    ``gap`` [m] above it at a ``time`` [s], on its way down or up. Engines add gravity before they move a body, so that
    the parabola's own speed is less by half a step of it."""
    own, base = speed - 0.5 * GRAVITY * DT, height(time) + gap
    late, relative = 0.0, 0.0
    for _ in range(20):  # Newton's method
        there = time + late
        relative = own - GRAVITY * late - (height(there + 1e-5) - height(there - 1e-5)) / 2e-5
        late -= (base + own * late - 0.5 * GRAVITY * late**2 - height(there)) / relative
    return relative


def touchdown_table() -> tuple[str, dict[str, dict[str, list[float]]]]:
    """Return the table, with the most and least of eight phases, and all figures by engine and coefficient."""
    phases = [2.0 * math.pi * k / PHASES for k in range(PHASES)]
    rows, found = [], {}
    for name in entrants():
        rest = number(rebound(name, RESTITUTIONS[1], None))
        found[name] = {f"{e}": [rebound(name, e, phase) for phase in phases] for e in RESTITUTIONS}
        rows.append([name, rest, *(f"{min(values):.3f} to {max(values):.3f}" for values in found[name].values())])
    return table(["engine", f"at rest, e = {RESTITUTIONS[1]}", *(f"e = {e}" for e in RESTITUTIONS)], rows), found
