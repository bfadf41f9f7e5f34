"""Rows on ground that moves: heave, launch, waves, slow maps; and on what changes at once: holes, maps, places."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from smartmesh_ros import BodyState, Box, Capsule, Cylinder, HeightMap, PhysicsConfig, Sphere
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.matrix.arena import ANY, HUSKY, Arena, Method, Row, deepest, lost_in, off, square
from studies.matrix.rules import HILLS

BALL, START = Sphere(0.2), (0.013, 0.017, 0.2)
LIFTED: dict[str, Any] = {"size": 21, "map_rate": 240.0}
# Ground that falls away at 2 g by 2 m.
DROP: dict[str, Any] = {"ground": {"kind": "drop", "acceleration": 2.0 * GRAVITY, "depth": 2.0}, **LIFTED}


def _rising(speed: float, method: Method) -> float:
    """Penetration [mm] of a ball on ground that has risen for a quarter of a second."""
    with Arena(method, {"kind": "lift", "speed": speed, "duration": 2.0}, **LIFTED) as arena:
        arena.spawn("ball", BALL, START)
        return deepest(arena, 1.0, 0.25, every=1, share=100.0)


def _launch(speed: float, method: Method) -> float:
    """Error [%] of the height to which a ball is thrown by ground that rises and stops."""
    with Arena(method, {"kind": "lift", "speed": speed, "duration": 1.0}, **LIFTED) as arena:
        arena.spawn("ball", BALL, START)
        highest = max(arena.most(1.1 + speed / GRAVITY, lambda: arena.positions()[0, 2] - 0.2 - speed), 0.0)
        # As a share of the whole rise, and of the throw where that is the larger part.
        throw = speed**2 / (2.0 * GRAVITY)
        return 100.0 * abs(highest - throw) / max(throw, speed)


def drags(method: Method) -> float:
    """Error [%] of the speed of a box on level ground that slides sideways at 0.5 m/s: the map's origin moves."""
    with Arena(method, size=41) as arena:
        arena.rest_of(Box(0.4, 0.4, 0.2), (0.013, 0.017, 0.1), 0.25)
        geometry = square(41, 0.25)
        for step in range(240):
            if step % 4 == 0:
                x, y, z = geometry.origin
                moved = replace(geometry, origin=(x + 0.5 * step / 240.0, y, z))
                arena.world.terrain.put("", HeightMap(np.zeros((41, 41)), geometry=moved, time=arena.world.time))
            arena.world.step()
        return 100.0 * abs(float(arena.velocities()[0, 0]) / 0.5 - 1.0)


def falls_away(method: Method) -> float:
    """By how many steps a ball lags behind free fall over ground that falls away at 2 g."""
    with Arena(method, **DROP) as arena:
        arena.spawn("ball", BALL, START)
        worst = 0.0
        dt = 1.0 / 240.0
        for time in arena.run(0.9 * math.sqrt(2.0 * 2.0 / GRAVITY)):
            expected = 0.2 - 0.5 * GRAVITY * time * (time + dt)  # symplectic Euler falls a little further
            worst = max(worst, abs(float(arena.positions()[0, 2]) - expected) / (GRAVITY * time * dt))
        return worst


def floats(method: Method) -> float:
    """Largest gap or penetration [mm] of a ball on level ground that heaves by 0.5 m every 2 s, well below g."""
    with Arena(method, {"kind": "heave", "height": 0.5, "period": 2.0}, **LIFTED) as arena:
        arena.rest_of(BALL, START, 0.5)
        return 1e3 * arena.most(2.0, lambda: abs(float(arena.clearances()[0])))


WAVES: dict[int, dict[str, Any]] = {
    frequency: {"kind": "waves", "amplitude": amplitude, "number": number, "frequency": float(frequency)}
    for frequency, amplitude, number in ((1, 0.3, 1.0), (4, 0.3, 1.0), (8, 0.5, 1.5), (16, 0.5, 1.5))
}


def _waves(
    measure: Callable[[Arena], float], frequency: int, method: Method, shape: Shape = BALL,
    map_rate: float = 240.0, rate: float = 240.0, **state: Any,
) -> float:  # fmt: skip
    """What is measured of 16 bodies on waves."""
    physics = PhysicsConfig(rate=rate)
    with Arena(method, WAVES[frequency], size=61, map_rate=map_rate, physics=physics) as arena:
        arena.scatter(16, shape, 4.0, shape.bounding_radius + 0.05, **state)
        return measure(arena)


# Penetration [mm], 99 %, infinite where a body is lost; and how many are lost at any time.
_rides = partial(_waves, partial(deepest, seconds=1.5, settle=0.5))
_loses = partial(_waves, partial(lost_in, seconds=1.5))


def crowd(method: Method) -> float:
    """Bodies lost of 1,000 balls packed close on waves, maps at 60 Hz and steps at 120 Hz."""
    with Arena(method, WAVES[4], size=61, map_rate=60.0, physics=PhysicsConfig(rate=120.0)) as arena:
        ball = Sphere(0.1)
        for index in range(1000):
            x, y = 0.21 * (index % 32 - 15.5), 0.21 * (index // 32 - 15.5)
            z = float(arena.heightmap.at([[x, y]], 0.0).heights[0])
            arena.spawn(f"ball_{index}", ball, (x, y, z + 0.15))
        return lost_in(arena, 0.25)


def robot(method: Method) -> float:
    """Links of a driving four-wheeled robot whose centre is ever below the ground on slow waves."""
    with Arena(method, WAVES[1], size=61, map_rate=60.0) as arena:
        arena.world.spawn_robot("husky", HUSKY, BodyState((0.0, 0.0, 0.6)))
        for joint in arena.world.bodies["husky"].joints:
            arena.world.drive("husky", joint, 5.0)
        gone: set[str] = set()
        for _ in arena.run(2.0):
            gone.update(arena.world.below_ground())
        return float(len(gone))


_LANDS = partial(off, BALL, START, (ANY, ANY, -1.8), seconds=2.0, **DROP)
_STEADY = "theory: the ball stays on"
_UNKNOWN = "free fall; in the first step nobody knows of it"
_FACTS = "a limit of this project, 99 %"
_MOVING = (
    Row("T5 ground rising, 0.1 m/s", partial(_rising, 0.1), 1.0, "mm", _STEADY),
    Row("T5 ground rising, 1 m/s", partial(_rising, 1.0), 1.0, "mm", _STEADY),
    Row("T5 ground rising, 3 m/s", partial(_rising, 3.0), 1.0, "mm", _STEADY, quick=True),
    Row("launch, 0.5 m/s", partial(_launch, 0.5), 2.0, "%", "ballistics"),
    Row("launch, 2 m/s", partial(_launch, 2.0), 2.0, "%", "ballistics", quick=True),
    Row("launch, 8 m/s", partial(_launch, 8.0), 2.0, "%", "ballistics"),
    Row("T5 ground sliding, 0.5 m/s", drags, 5.0, "%", "theory: the box goes along"),
    Row("ground falling at 2 g", falls_away, 1.0, "steps late", _UNKNOWN, quick=True),
    Row("landing after it", _LANDS, 1.0, "mm", "rest height"),
    Row("floating on heaving ground", floats, 1.0, "mm", _STEADY),
    Row("waves, w = 1", partial(_rides, 1), 2.0, "mm", _FACTS),
    Row("waves, w = 4", partial(_rides, 4), 4.0, "mm", _FACTS, quick=True),
    Row("waves, w = 8", partial(_rides, 8), 2.0, "mm", _FACTS),
    Row("waves, w = 16", partial(_loses, 16), 0.0, "lost", "none lost", quick=True),
    Row("w = 4, maps at 60 Hz", partial(_rides, 4, map_rate=60.0), 6.0, "mm", _FACTS),
    Row("w = 4, maps at 20 Hz", partial(_rides, 4, map_rate=20.0), 12.0, "mm", _FACTS, quick=True),
    Row("w = 4, maps at 10 Hz", partial(_loses, 4, map_rate=10.0), 0.0, "lost", "none lost"),
    Row("w = 4, physics at 60 Hz", partial(_loses, 4, rate=60.0, map_rate=60.0), 0.0, "lost", "none lost"),
    Row("w = 4, physics at 480 Hz", partial(_rides, 4, rate=480.0), 4.0, "mm", _FACTS),
    Row("boxes, w = 4", partial(_rides, 4, shape=Box(0.5, 0.4, 0.3)), 4.0, "mm", _FACTS),
    Row("cylinders, w = 4", partial(_rides, 4, shape=Cylinder(radius=0.2, height=0.3)), 4.0, "mm", _FACTS),
    Row("capsules, w = 4", partial(_rides, 4, shape=Capsule(radius=0.15, height=0.3)), 4.0, "mm", _FACTS),
    Row("balls at 40 m/s, w = 4", partial(_loses, 4, linear=(0.0, 0.0, -40.0)), 0.0, "lost", "none lost"),
    Row("1,000 balls packed close", crowd, 0.0, "lost", "none lost", skip=("rebuilt trimesh", "convex hull")),
    Row("a robot on waves", robot, 0.0, "links lost", "none lost"),
)


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
        before, worst = arena.rest_of(Box(0.4, 0.4, 0.2), (0.013, 0.017, 0.1))[2], 0.0
        for size, resolution in ((101, 0.1), (41, 0.3), (151, 0.05), (31, 0.5)):
            level = HeightMap(np.zeros((size, size)), geometry=square(size, resolution), time=arena.world.time)
            arena.world.terrain.put("", level)
            worst = max(worst, arena.most(30 / 240.0, lambda: abs(arena.positions()[0, 2] - before)))
        return 1e3 * worst


def sinks_beside(method: Method) -> float:
    """How far [mm] a box is above 10 cm under its place, a second after all but the nearest sample sank by 1 m."""
    with Arena(method, {"kind": "noise", "deviation": 0.01}) as arena:
        before = arena.rest_of(Box(0.3, 0.3, 0.2), (0.1, 0.05, 0.15))
        nearest = np.rint(arena.geometry.to_grid(before[:2])).astype(int)
        sunk = arena.heightmap.heights - 1.0
        sunk[nearest[0], nearest[1]] += 1.0
        arena.tell(sunk)
        arena.settle(1.0)
        return 1e3 * max(float(arena.positions()[0, 2]) - (float(before[2]) - 0.1), 0.0)


_HOLE = np.pad(np.full((21, 21), np.nan), 20)
_RIM = partial(off, Sphere(0.1), (-2.85, 0.017, 0.1), (ANY, ANY, 0.1), ground=_HOLE)
_CORNER = partial(off, Sphere(0.3), (-7.4, -7.4, 0.3), (ANY, ANY, 0.3))
_CHANGES = (
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
ROWS = (*_MOVING, *_CHANGES)
