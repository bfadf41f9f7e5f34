"""The scenes of the study: robots on grounds that rest or move, on grids of three spacings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from smartmesh_ros import GridGeometry
from smartmesh_ros.scenes.moving import FloatGrid, Scene, Wave
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.distance import Surface
from studies.matrix.arena import square
from studies.robots.robot import HUSKY, LAIKAGO, RACECAR, ROVER, Robot, trot_at

# A wave whose ground moves at up to 0.2 m/s and 0.8 m/s^2, upwards and downwards.
HEAVING = Wave(amplitude=0.05, number=1.0, frequency=4.0)
STILL = Wave(amplitude=0.0)


class RoughHills(Scene):
    """Hills of a height [m] with independent normally distributed noise of 1 cm at every sample, and a ``wave`` along x
    that carries all of it up and down."""

    def __init__(self, geometry: GridGeometry, wave: Wave, hills: float = 0.1) -> None:
        super().__init__(geometry)
        self.wave = wave
        noise = np.random.default_rng(0).normal(0.0, 0.01, (geometry.rows, geometry.columns))
        self._still: FloatGrid = (hills * np.sin(1.5 * self.x) * np.cos(1.1 * self.y) + noise).astype(np.float32)

    def heights(self, time: float) -> FloatGrid:
        wave = self.wave
        if wave.amplitude == 0.0:
            return self._still
        heave = np.float32(wave.amplitude) * np.sin(wave.number * self.x - np.float32(wave.frequency * time))
        heights: FloatGrid = self._still + heave.astype(np.float32)
        return heights


# Side of the map [m], and where the robots start: side by side, with room to move along x [m].
SIDE = 6.0
STARTS = ((-1.2, -1.8), (-1.2, 0.0), (-1.2, 1.8))
# Height of the hills [m]: legged robots that only hold their joints stay on their feet.
HILLS = 0.05
# Gap below the lowest point of a robot that starts over the highest ground around it [m].
GAP = 0.005

Motion = Literal["rest", "wave", "maps"]
# By motion of the ground: rate of the maps [Hz], and words.
MOTIONS: dict[Motion, tuple[float, str]] = {
    "rest": (0.0, "ground at rest"),
    "wave": (60.0, "heaving ground, maps at 60 Hz"),
    "maps": (20.0, "heaving ground, maps at 20 Hz"),
}


@dataclass(frozen=True, kw_only=True)
class RobotScene:
    """Three robots on rough hills, whose root links start at ``starts`` (N, 3) [m]. ``map_rate`` [Hz]: 0 = one map.
    ``speed`` [rad/s]: of the wheels. ``trot``: they walk, else they stand, or drive where the ground moves. ``quick``:
    part of the quick run. ``duration``, and ``settle`` that is not measured [s]. ``samples``: measurements in a second
    [Hz], no multiple of the rate of the maps, so that they see maps of every age."""

    name: str
    title: str
    robot: Robot
    ground: RoughHills
    starts: FloatArray
    map_rate: float
    speed: float
    trot: bool = False
    quick: bool = False
    duration: float = 2.0
    settle: float = 1.0
    samples: float = 30.0

    def surface(self, time: float) -> Surface:
        """Return the main mesh at ``time`` [s]."""
        return Surface(self.ground.geometry, np.asarray(self.ground.heights(time), np.float64))

    def joints(self, time: float) -> Mapping[str, float]:
        """Return the positions [rad] that the servos hold at ``time`` [s]."""
        return trot_at(time) if self.trot else self.robot.stance


def robot_scene(robot: Robot, motion: Motion, resolution: float, *, trot: bool = False) -> RobotScene:
    """Return a scene on a map of a ``resolution`` [m]."""
    map_rate, words = MOTIONS[motion]
    doing, cells = f"trotting {robot.name}" if trot else robot.name, f"{100.0 * resolution:.0f}"
    geometry = square(round(SIDE / resolution) + 1, resolution)
    ground = RoughHills(geometry, HEAVING if map_rate else STILL, hills=HILLS)
    heights, starts = ground.heights(0.0).astype(np.float64), []
    for x, y in STARTS:
        near = np.hypot(ground.x - x, ground.y - y) <= max(robot.reach, resolution)
        starts.append((x, y, heights[near].max() + robot.height + GAP))
    return RobotScene(
        name=f"{doing.replace(' ', '_')}_{motion}_{cells}cm", title=f"{doing}, {words}, {cells} cm grid", robot=robot,
        ground=ground, starts=np.array(starts), map_rate=map_rate, speed=robot.speed if map_rate else 0.0, trot=trot,
        quick=(robot, motion, resolution) in ((HUSKY, "rest", 0.1), (LAIKAGO, "maps", 0.1)),
    )  # fmt: skip


def scenes() -> list[RobotScene]:
    """Return all scenes."""
    grids: dict[Motion, tuple[float, ...]] = {"rest": (0.04, 0.1, 0.25), "wave": (0.1,), "maps": (0.04, 0.1, 0.25)}
    return [
        robot_scene(robot, motion, resolution, trot=trot)
        for robot, trot in ((ROVER, False), (HUSKY, False), (RACECAR, False), (LAIKAGO, False), (LAIKAGO, True))
        for motion, spacings in grids.items()
        for resolution in spacings
    ]
