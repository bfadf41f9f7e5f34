"""Rows on contacts beside the ground right below a body: seams, creases, walls, edges; and of bodies that a blow drives
on faster than their patches follow."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros import BodyState, Box, PhysicsConfig, Sphere
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.matrix.arena import Arena, Heights, Method, Row, deepest, off
from studies.matrix.still_ground import sinks
from studies.robots.urdf import joint_of, link_of

SLOPE = 0.3  # [-], less than the friction of 0.5


def on_corner(shape: Shape, height: float, drop: float) -> Callable[[Method], float]:
    """Return `off` for the corner of four cells, each a plane, all of which a body touches at rest at a ``height``
    [m]."""
    start, rest = (0.0, 0.0, height + drop), (0.0, 0.0, height)
    return partial(off, shape, start, rest, ground=lambda x, y: SLOPE * (np.abs(x) + np.abs(y)), size=21)


def rolls_over_corners(method: Method) -> float:
    """Deepest penetration [mm] of a ball that rolls along a row of samples which are 1 cm up and down in turns."""
    with Arena(
        method, lambda x, y: 0.01 * np.cos(np.pi * np.rint(x / 0.25)) * np.cos(np.pi * np.rint(y / 0.25)), size=21
    ) as arena:
        arena.spawn("ball", Sphere(0.2), (0.25, 0.0, 0.2), linear=(0.5, 0.0, 0.0), angular=(0.0, 2.5, 0.0))
        return deepest(arena, 2.0, 0.0, every=1, share=100.0)


_CREASE_CELLS = (1.0, 0.1)  # a cell larger and cells smaller than the box [m]
_CELLS = "cells of 1 and 0.1 m"


def box_in_valley(method: Method) -> float:
    """Error [mm] of the rest height of a box across a valley, which stands on two of its edges; the worst of cells."""
    rest = (0.0, 0.013, SLOPE * 0.2 + 0.1)
    box = partial(off, Box(0.4, 0.3, 0.2), (*rest[:2], rest[2] + 0.005), rest, size=21)
    return max(box(method, ground=lambda x, y: SLOPE * np.abs(x), resolution=cell) for cell in _CREASE_CELLS)


def box_on_ridge(method: Method) -> float:
    """Deepest penetration [mm] of a box that lies across a ridge and tips to its heavier side; the worst of cells.
    Infinite where it does not come to lie on that slope."""
    worst = 0.0
    for resolution in _CREASE_CELLS:
        with Arena(method, lambda x, y: -SLOPE * np.abs(x), size=21, resolution=resolution) as arena:
            arena.spawn("box", Box(0.4, 0.3, 0.2), (0.05, 0.013, 0.101))
            worst = max(worst, deepest(arena, 2.0, 0.0, every=1, share=100.0))
            _, y, _, w = arena.world.state("box").orientation
            tilt = 2.0 * math.atan2(y, w)
            if abs(tilt - math.atan(SLOPE)) > math.radians(1.0) or abs(float(arena.clearances()[0])) > 2e-3:
                return math.inf
    return worst


_BLOCK = '<collision><geometry><box size="{}"/></geometry></collision>'
_LINKS = link_of("base", 50.0, (2.0, 2.0, 2.0), _BLOCK.format("0.3 0.3 0.1")) + link_of(
    "bar", 1.0, (0.001, 0.0836, 0.0836), _BLOCK.format("1.0 0.05 0.05")
)
_MOUNT = '<origin xyz="0 0 0.1"/><limit effort="5" velocity="50"/>'
_SPINNER = f'<robot name="spinner">{_LINKS}{joint_of("spin", "base", "bar", "0 0 1", _MOUNT)}</robot>'


def spins_into_wall(method: Method) -> float:
    """How far [deg] from where its end meets a wall that stands beside it a turning bar gets."""
    # Samples from 0.25 m on stand on top.
    with Arena(method, lambda x, y: np.where(y > 0.225, 0.5, 0.0), size=61, resolution=0.05) as arena:
        arena.world.spawn_robot("spinner", _SPINNER, BodyState((0.0, 0.0, 0.05)))
        arena.world.drive("spinner", "spin", 20.0, 5.0)
        body = arena.world.bodies["spinner"]
        furthest = 0.0
        for _ in arena.run(1.0):
            angle = arena.world.client.getJointState(body.uid, 0)[0]
            heading = arena.world.client.getEulerFromQuaternion(arena.world.state("spinner").orientation)[2]
            furthest = max(furthest, angle + heading)
        # The end's corner that leads, against the wall's face at the height of the bar's upper edge.
        across = 0.2 + 0.05 * (0.1 + 0.05 + 0.025) / 0.5
        meets = math.asin(across / math.hypot(0.5, 0.025)) - math.atan2(0.025, 0.5)
        return math.degrees(abs(furthest - meets))


def _trench(x: FloatArray, y: FloatArray) -> Any:
    """Level ground with a trench whose lips are 0.3 m apart, too narrow for a ball of 0.2 m."""
    return np.where(np.abs(x) < 0.125, -0.5, 0.0)


_HELD, _LIPS = Sphere(0.2), (0.0, 0.013, math.sqrt(0.2**2 - 0.15**2))


def trench_opens(method: Method) -> float:
    """How far [mm] a ball that two lips held is above 0.3 m below the ground, a second after one of them sank; infinite
    where they did not hold it."""
    with Arena(method, _trench, size=61, resolution=0.05) as arena:
        if 1e3 * math.dist(arena.rest_of(_HELD, (0.0, 0.013, 0.15)), _LIPS) > 10.0:
            return math.inf
        sunk = np.array(arena.heightmap.heights[:, :29]) - 1.0  # all of x <= -0.1 m
        arena.heightmap.update_region(0, 0, sunk, time=arena.world.time)
        arena.settle(1.0)
        return 1e3 * max(float(arena.positions()[0, 2]) + 0.3, 0.0)


_BALL = on_corner(Sphere(0.2), 0.2 * math.sqrt(1.0 + 2.0 * SLOPE**2), 0.01)
_BOX = on_corner(Box(0.12, 0.1, 0.08), SLOPE * (0.06 + 0.05) + 0.04, 0.005)
# It rolls along a seam, the bottom of a groove, on two circles, nearer to its axis than its own radius.
_SECANT = math.hypot(1.0, SLOPE)
_SEAM = partial(
    off, Sphere(0.2), (0.0, 0.0, 0.2 * _SECANT), (0.4, 0.0, 0.2 * _SECANT), seconds=2.0,
    state={"linear": (0.2, 0.0, 0.0), "angular": (0.0, _SECANT, 0.0)}, ground=lambda x, y: SLOPE * np.abs(y), size=21,
)  # fmt: skip
_ON_LIPS = partial(off, _HELD, (*_LIPS[:2], 0.15), _LIPS, ground=_trench, size=61, resolution=0.05)
_THIN_BOX = partial(sinks, Box(2.0, 0.1, 0.05), {"kind": "noise", "deviation": 0.01}, 81, 0.05, 0.1, 0.8)


RATE = 240.0  # [Hz]
_HIT = 6.0  # [m/s]
_SMOOTH = PhysicsConfig(friction=0.0, sleep=False)


def _step(start: float, height: float) -> Heights:
    """Level ground, and from where x > ``start`` [m] on at a ``height`` [m]."""
    return lambda x, y: np.where(x > start, height, 0.0)


@contextmanager
def _blow(method: Method, shape: Shape, height: float, form: Any = 0.0) -> Iterator[Arena]:
    """Yield an arena whose body lay still and is hit, right after an update of its patch."""
    with Arena(method, form, size=61, physics=_SMOOTH) as arena:
        arena.spawn("body", shape, (0.013, 0.017, height))
        arena.settle(1.0 + 1.0 / RATE)
        arena.world.client.resetBaseVelocity(arena.world.bodies["body"].uid, (_HIT, 0.0, 0.0), (0.0, 0.0, 0.0))
        yield arena


def _seldom(method: Method) -> Method:
    """The method with colliders at 4 Hz, so that a body gets far between two updates."""
    return None if method is None else replace(method, rate=4.0)


def hit_on_flat_ground(method: Method) -> float:
    """Error [mm] of where a box without friction is at any time within half a second of a blow to 6 m/s."""
    with _blow(_seldom(method), Box(0.4, 0.4, 0.2), 0.1) as arena:
        start, worst = arena.positions()[0], 0.0
        for step, _ in enumerate(arena.run(0.5)):
            worst = max(worst, math.dist(arena.positions()[0], start + ((step + 1) * _HIT / RATE, 0.0, 0.0)))
        return 1e3 * worst


def hit_over_an_edge(method: Method) -> float:
    """Error [mm] of the height of a ball that a blow to 6 m/s drives over an edge, beyond which it falls freely."""
    with _blow(_seldom(method), Sphere(0.2), 0.2, _step(0.6, -1.0)) as arena:  # level up to a sample at 0.5 m
        worst, fall = 0.0, 0.0
        for _ in arena.run(0.35):
            x, _, z = arena.positions()[0].tolist()
            fall = max((x - 0.5) / _HIT, 0.0)
            worst = max(worst, abs(z - (0.2 - 0.5 * GRAVITY * fall**2)))
        return 1e3 * worst if fall > 0.25 else math.inf


def hit_against_a_step(method: Method) -> float:
    """Deepest penetration [mm] of a ball of 0.2 m that a blow to 6 m/s drives against a step of twice its radius."""
    with _blow(method, Sphere(0.2), 0.2, _step(0.6, 0.4)) as arena:
        return deepest(arena, 0.35, 0.0, every=1, share=100.0)


def on_cliff(beyond: float, low: float, high: float, method: Method) -> float:
    """How far [mm] the middle of a box is outside of heights from ``low`` to ``high`` [m], 2 s after it was put down
    with its middle ``beyond`` [m] the edge of a cliff of 2 m; at 0.1 m it stays."""
    with Arena(method, _step(0.1, -2.0), size=41) as arena:
        height = float(arena.rest_of(Box(0.4, 0.3, 0.2), (beyond, 0.013, 0.101), 2.0)[2])
        return 1e3 * max(height - high, low - height, 0.0)


_TIPS, _STAYS = partial(on_cliff, 0.02, -math.inf, -0.5), partial(on_cliff, -0.02, 0.1, 0.1)
_AT_6 = "main mesh; a step at 6 m/s"
ROWS = (
    Row("ball on the corner of four cells", _BALL, 1.0, "mm", "geometry: r sqrt(1 + 2 s^2)", quick=True),
    Row("small box on the corner of four cells", _BOX, 0.5, "mm", "geometry: stands on its corners"),
    Row("rolling along a seam", _SEAM, 5.0, "mm", "theory: v t, r sec(slope); PyBullet gains 2 % of speed"),
    Row("rolling over corners of cells", rolls_over_corners, 1.0, "mm", "main mesh"),
    Row(f"box across a valley, {_CELLS}", box_in_valley, 1.0, "mm", "geometry: stands on its edges", quick=True),
    Row(f"box across a ridge, {_CELLS}", box_on_ridge, 4.0, "mm", "main mesh, a step at 1 m/s; the slope's tilt"),
    Row("a bar that spins into a wall", spins_into_wall, 4.0, "deg", "geometry; two steps at 8 rad/s", quick=True),
    Row("ball on the lips of a trench", _ON_LIPS, 1.0, "mm", "geometry: sqrt(r^2 - (width / 2)^2)", quick=True),
    Row("one of them sinks away", trench_opens, 0.0, "mm", "it falls in", quick=True),
    Row("long thin box on fine noise", _THIN_BOX, 4.0, "mm", "main mesh, 99 %; a step at 1 m/s"),
    Row("hit to 6 m/s, colliders at 4 Hz", hit_on_flat_ground, 1.0, "mm", "a plane; theory: 6 m/s on"),
    Row("hit over an edge, colliders at 4 Hz", hit_over_an_edge, 25.0, "mm", "ballistics; two steps late", quick=True),
    Row("hit against a step", hit_against_a_step, 25.0, "mm", _AT_6, quick=True),
    Row("hit against a step, colliders at 4 Hz", lambda method: hit_against_a_step(_seldom(method)), 25.0, "mm", _AT_6),
    Row("box 2 cm over a cliff's edge", _TIPS, 0.0, "mm", "statics: it tips", quick=True),
    Row("box 2 cm before it", _STAYS, 1.0, "mm", "statics: it stays"),
)
