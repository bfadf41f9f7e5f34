"""Rows of bodies that a blow drives on faster than their patches follow, and of bodies at an edge."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Box, Shape, Sphere
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.matrix.arena import Arena, deepest
from studies.matrix.row import Row

RATE = 240.0  # [Hz]
_HIT = 6.0  # [m/s]


def _hit_sideways(arena: Arena, shape: Shape, height: float) -> None:
    """Has a body lie still, and hits it right after an update of its patch."""
    arena.spawn("body", shape, (0.013, 0.017, height))
    arena.frictionless()
    arena.settle(1.0 + 1.0 / RATE)
    client, uid = arena.world.client, arena.world.bodies["body"].uid
    client.resetBaseVelocity(uid, (_HIT, 0.0, 0.0), (0.0, 0.0, 0.0))


def _seldom(method: PatchConfig) -> PatchConfig:
    """The method with patches at 4 Hz, so that a body gets far between two updates."""
    return replace(method, rate=4.0)


def hit_on_flat_ground(method: PatchConfig) -> float:
    """Error [mm] of where a box without friction is at any time within half a second of a blow to 6 m/s."""
    with Arena(_seldom(method), size=61, physics=PhysicsConfig(friction=0.0, sleep=False)) as arena:
        _hit_sideways(arena, Box(0.4, 0.4, 0.2), 0.1)
        start, worst = arena.positions()[0], 0.0
        for step, _ in enumerate(arena.run(0.5)):
            worst = max(worst, math.dist(arena.positions()[0], start + ((step + 1) * _HIT / RATE, 0.0, 0.0)))
        return 1e3 * worst


def hit_over_an_edge(method: PatchConfig) -> float:
    """Error [mm] of the height of a ball that a blow to 6 m/s drives over an edge, beyond which it falls freely."""
    with Arena(_seldom(method), size=61, physics=PhysicsConfig(friction=0.0, sleep=False)) as arena:
        arena.form(lambda x, y: np.where(x > 0.6, -1.0, 0.0))  # level up to the sample at 0.5 m
        _hit_sideways(arena, Sphere(0.2), 0.2)
        worst, fall = 0.0, 0.0
        for _ in arena.run(0.35):
            x, _, z = arena.positions()[0].tolist()
            fall = max((x - 0.5) / _HIT, 0.0)
            worst = max(worst, abs(z - (0.2 - 0.5 * GRAVITY * fall**2)))
        return 1e3 * worst if fall > 0.25 else math.inf


def hit_against_a_step(method: PatchConfig) -> float:
    """Deepest penetration [mm] of a ball of 0.2 m that a blow to 6 m/s drives against a step of twice its radius."""
    with Arena(method, size=61, physics=PhysicsConfig(friction=0.0, sleep=False)) as arena:
        arena.form(lambda x, y: np.where(x > 0.6, 0.4, 0.0))
        _hit_sideways(arena, Sphere(0.2), 0.2)
        return deepest(arena, 0.35, 0.0, every=1, share=100.0)


def height_on_cliff(method: PatchConfig, beyond: float) -> float:
    """Height [m], 2 s later, of the middle of a box that was put down with its middle ``beyond`` [m] the edge of a
    cliff of 2 m; 0.1 m where it stays."""
    with Arena(method, size=41) as arena:
        arena.form(lambda x, y: np.where(x > 0.1, -2.0, 0.0))
        arena.spawn("box", Box(0.4, 0.3, 0.2), (beyond, 0.013, 0.101))
        arena.settle(2.0)
        return float(arena.positions()[0, 2])


ROWS = (
    Row("hit to 6 m/s, patches at 4 Hz", hit_on_flat_ground, 1.0, "mm", "a plane; theory: 6 m/s on"),
    Row("hit over an edge, patches at 4 Hz", hit_over_an_edge, 25.0, "mm", "ballistics; two steps late", quick=True),
    Row("hit against a step", hit_against_a_step, 25.0, "mm", "main mesh; a step at 6 m/s", quick=True),
    Row(
        "hit against a step, patches at 4 Hz",
        lambda method: hit_against_a_step(_seldom(method)),
        25.0,
        "mm",
        "main mesh; a step at 6 m/s",
    ),
    Row(
        # It has fallen where it is half a metre below the edge.
        "box 2 cm over a cliff's edge",
        lambda method: 1e3 * max(height_on_cliff(method, 0.02) + 0.5, 0.0),
        0.0,
        "mm",
        "statics: it tips",
        quick=True,
    ),
    Row(
        "box 2 cm before it",
        lambda method: 1e3 * abs(height_on_cliff(method, -0.02) - 0.1),
        1.0,
        "mm",
        "statics: it stays",
    ),
)
