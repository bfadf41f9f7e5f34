"""Rows of bodies that a blow drives on faster than their patches follow, and of bodies at an edge."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from smartmesh_ros.evaluation.measures import GRAVITY
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.config import PhysicsConfig
from smartmesh_ros.physics.shapes import Box, Shape, Sphere
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
    return replace(method, rate=4.0)


def hit_on_flat_ground(method: PatchConfig) -> float:
    """Error [mm] of where a box without friction is at any time within half a second of a blow to 6 m/s."""
    with Arena(_seldom(method), size=61, physics=PhysicsConfig(friction=0.0)) as arena:
        _hit_sideways(arena, Box(0.4, 0.4, 0.2), 0.1)
        start, worst = arena.positions()[0], 0.0
        for step, _ in enumerate(arena.run(0.5)):
            worst = max(worst, math.dist(arena.positions()[0], start + ((step + 1) * _HIT / RATE, 0.0, 0.0)))
        return 1e3 * worst


def hit_over_an_edge(method: PatchConfig) -> float:
    """Error [mm] of the height of a ball that a blow to 6 m/s drives over an edge, beyond which it falls freely."""
    with Arena(_seldom(method), size=61, physics=PhysicsConfig(friction=0.0)) as arena:
        arena.form(lambda x, y: np.where(x > 0.6, -1.0, 0.0))  # level up to the sample at 0.5 m
        _hit_sideways(arena, Sphere(0.2), 0.2)
        worst, fall = 0.0, 0.0
        for _ in arena.run(0.35):
            x, _, z = arena.positions()[0].tolist()
            fall = max((x - 0.5) / _HIT, 0.0)
            worst = max(worst, abs(z - (0.2 - 0.5 * GRAVITY * fall**2)))
        return 1e3 * worst if fall > 0.25 else math.inf


def hit_against_a_step(method: PatchConfig) -> float:
    """Deepest penetration [mm] of a ball that a blow to 6 m/s drives against a step as high as itself."""
    with Arena(method, size=61, physics=PhysicsConfig(friction=0.0)) as arena:
        arena.form(lambda x, y: np.where(x > 0.6, 0.4, 0.0))
        _hit_sideways(arena, Sphere(0.2), 0.2)
        return deepest(arena, 0.35, 0.0, every=1, share=100.0)


def hit_against_a_step_seldom(method: PatchConfig) -> float:
    """The same with patches at 4 Hz."""
    return hit_against_a_step(_seldom(method))


def _on_cliff(method: PatchConfig, beyond: float) -> float:
    """Height [m], 2 s later, of the middle of a box put down so far ``beyond`` the edge of a cliff of 2 m."""
    with Arena(method, size=41) as arena:
        arena.form(lambda x, y: np.where(x > 0.1, -2.0, 0.0))
        arena.spawn("box", Box(0.4, 0.3, 0.2), (beyond, 0.013, 0.101))
        arena.settle(2.0)
        return float(arena.positions()[0, 2])


def falls_off_cliff(method: PatchConfig) -> float:
    """How far [mm] above half a metre below the edge a box is whose middle was 2 cm beyond it."""
    return 1e3 * max(_on_cliff(method, 0.02) + 0.5, 0.0)


def stays_on_cliff(method: PatchConfig) -> float:
    """Error [mm] of the rest height of a box whose middle is 2 cm before the edge of a cliff."""
    return 1e3 * abs(_on_cliff(method, -0.02) - 0.1)


ROWS = (
    Row(
        name="hit to 6 m/s, patches at 4 Hz", figure=hit_on_flat_ground, limit=1.0, unit="mm",
        source="a plane; theory: 6 m/s on",
    ),
    Row(
        name="hit over an edge, patches at 4 Hz", figure=hit_over_an_edge, limit=25.0, unit="mm",
        source="ballistics; two steps late", quick=True,
    ),
    Row(
        name="hit against a step", figure=hit_against_a_step, limit=25.0, unit="mm",
        source="main mesh; a step at 6 m/s", quick=True,
    ),
    Row(
        name="hit against a step, patches at 4 Hz", figure=hit_against_a_step_seldom, limit=25.0, unit="mm",
        source="main mesh; a step at 6 m/s",
    ),
    Row(
        name="box 2 cm over a cliff's edge", figure=falls_off_cliff, limit=0.0, unit="mm", source="statics: it tips",
        quick=True,
    ),
    Row(name="box 2 cm before it", figure=stays_on_cliff, limit=1.0, unit="mm", source="statics: it stays"),
)  # fmt: skip
