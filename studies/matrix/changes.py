"""Rows in which something changes at once: holes, maps, kinds, positions."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from smartmesh_ros.ground.shapes import Box, Sphere
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.matrix.arena import ANY, Arena, off, square
from studies.matrix.row import Method, Row
from studies.matrix.rules import HILLS


def _buried(centre: float, method: Method) -> float:
    """Fastest way up [m/s] of a ball that starts in the ground; infinite where it does not come out in 2 s."""
    with Arena(method, size=21) as arena:
        arena.spawn("ball", Sphere(0.2), (0.013, 0.017, centre))
        fastest = arena.most(2.0, lambda: float(arena.velocities()[0, 2]))
        return fastest if abs(arena.positions()[0, 2] - 0.2) < 5e-3 else math.inf


def _falls(shape: Box | Sphere, centre: float, rests: float, ground: float, method: Method) -> float:
    """Steps until a body that rests with its ``centre`` [m] above the ground for a while [s] falls when the ``ground``
    under it goes down to a height [m], NaN = a hole."""
    with Arena(method) as arena:
        arena.rest_of(shape, (0.013, 0.017, centre), rests)
        arena.heightmap.update_region(20, 20, np.full((21, 21), ground), time=arena.world.time)
        for step, _ in enumerate(arena.run(1.0)):
            if arena.velocities()[0, 2] < -0.5 * GRAVITY / 240.0:
                return float(step + 1)
        return math.inf


def teleports(method: Method) -> float:
    """Deepest penetration [mm] of a ball that is put down somewhere else on hills every 12 steps."""
    rng = np.random.default_rng(4)
    with Arena(method, HILLS) as arena:
        arena.spawn("ball", Sphere(0.2), (0.0, 0.0, 1.0))
        uid = arena.world.bodies["ball"].uid
        worst = 0.0
        for _ in range(40):
            x, y = rng.uniform(-6.0, 6.0, 2).tolist()
            ground = float(arena.heightmap.at([[x, y]], 0.0).heights[0])
            arena.world.client.resetBasePositionAndOrientation(uid, (x, y, ground + 0.23), (0, 0, 0, 1))
            arena.world.client.resetBaseVelocity(uid, (0, 0, -1.0), (0, 0, 0))
            worst = max(worst, arena.most(12 / 240.0, lambda: -float(arena.clearances()[0])))
        return 1e3 * worst


def maps_change(method: Method) -> float:
    """Largest rise or fall [mm] of a box at rest while maps of other sizes and resolutions replace its own."""
    with Arena(method) as arena:
        arena.spawn("box", Box(0.4, 0.4, 0.2), (0.013, 0.017, 0.1))
        arena.settle(1.0)
        before, worst = arena.positions()[0, 2], 0.0
        for size, resolution in ((101, 0.1), (41, 0.3), (151, 0.05), (31, 0.5)):
            level = HeightMap(np.zeros((size, size)), geometry=square(size, resolution), time=arena.world.time)
            arena.world.terrain.put("", level)
            worst = max(worst, arena.most(30 / 240.0, lambda: abs(arena.positions()[0, 2] - before)))
        return 1e3 * worst


def sinks_beside(method: Method) -> float:
    """How far [mm] a box is above 10 cm under its place, a second after all but the nearest sample sank by 1 m."""
    with Arena(method, {"kind": "noise", "deviation": 0.01}) as arena:
        arena.spawn("box", Box(0.3, 0.3, 0.2), (0.1, 0.05, 0.15))
        arena.settle(1.0)
        before = arena.positions()[0]
        nearest = np.rint(arena.geometry.to_grid(before[:2])).astype(int)
        sunk = arena.heightmap.heights - 1.0
        sunk[nearest[0], nearest[1]] += 1.0
        arena.tell(sunk)
        arena.settle(1.0)
        return 1e3 * max(float(arena.positions()[0, 2]) - (float(before[2]) - 0.1), 0.0)


_HOLE = np.pad(np.full((21, 21), np.nan), 20)
_RIM = partial(off, Sphere(0.1), (-2.85, 0.017, 0.1), (ANY, ANY, 0.1), ground=_HOLE)
_CORNER = partial(off, Sphere(0.3), (-7.4, -7.4, 0.3), (ANY, ANY, 0.3))
ROWS = (
    Row("T7 buried by half", partial(_buried, 0.05), 4.0, "m/s", "comes out, at a capped speed"),
    Row("T7 centre below the ground", partial(_buried, -0.1), 4.0, "m/s", "comes out, at a capped speed", quick=True),
    Row("T9 dug away", partial(_falls, Box(0.3, 0.3, 0.3), 0.15, 5.0, -1.0), 3.0, "steps", "a few steps", quick=True),
    Row("hole opens", partial(_falls, Sphere(0.2), 0.2, 1.0, np.nan), 3.0, "steps", "a few steps"),
    Row("rim of a hole", _RIM, 1.0, "mm", "rest height", skip=("whole trimesh",)),
    Row("corner of the map", _CORNER, 1.0, "mm", "rest height"),
    Row("teleporting ball", teleports, 10.0, "mm", "half of 0.5 m/s in a step and slop"),
    Row("maps change at rest", maps_change, 1.0, "mm", "nothing moves", quick=True),
    Row("ground sinks beside a sample", sinks_beside, 0.0, "mm", "it falls off", quick=True),
)
