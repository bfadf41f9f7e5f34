"""What measures the ground from the rover: a depth camera and a spinning lidar of several beams."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from smartmesh_ros.evaluation.distance import Surface
from smartmesh_ros.terrain.grid import FloatArray
from studies.mapper.poses import Pose
from studies.mapper.rays import cast_rays


@dataclass(frozen=True, kw_only=True)
class RangeNoise:
    """Normal noise of a range r: its standard deviation is ``constant`` [m] + ``quadratic`` [1/m] x r^2.

    The first is that of the clock or the lens, the second that of triangulation and of weak echoes.
    """

    constant: float
    quadratic: float

    def deviation(self, ranges: FloatArray) -> FloatArray:
        """Standard deviations [m] of ``ranges`` [m], same shape."""
        return np.asarray(self.constant + self.quadratic * ranges**2)


@dataclass(frozen=True, kw_only=True)
class RangeSensor(ABC):
    """A sensor of ranges on the rover.

    ``position_b`` (x, y, z) [m] in the body; it looks along x, ``pitch`` [rad] downwards. ``nearest`` and ``farthest``
    [m]: closer and farther ground gives no return. ``rate`` [Hz]: looks a second.
    """

    position_b: tuple[float, float, float]
    pitch: float
    nearest: float
    farthest: float
    noise: RangeNoise
    rate: float

    @abstractmethod
    def directions_s(self, look: int) -> FloatArray:
        """Unit directions (N, 3) of the rays of the look of that number: x forwards, z up."""

    def directions_b(self, look: int) -> FloatArray:
        """The same in the body."""
        return np.asarray(self.directions_s(look) @ Pose(0.0, 0.0, 0.0, 0.0, self.pitch, 0.0).rotation.T)


@dataclass(frozen=True, kw_only=True)
class DepthCamera(RangeSensor):
    """A stereo camera: a pinhole of ``columns`` x ``rows`` rays over ``view`` (horizontal, vertical) [rad].

    The defaults are a usual short-base camera above the bumper, thinned out to what a mapper keeps of it. Its noise is
    that of a disparity known to 0.08 pixels, 3 cm at 3.5 m.
    """

    position_b: tuple[float, float, float] = (0.3, 0.0, 0.6)
    pitch: float = math.radians(30.0)
    nearest: float = 0.3
    farthest: float = 5.0
    noise: RangeNoise = RangeNoise(constant=0.001, quadratic=0.0025)
    rate: float = 15.0
    columns: int = 64
    rows: int = 48
    view: tuple[float, float] = (math.radians(87.0), math.radians(58.0))

    def directions_s(self, look: int) -> FloatArray:
        """A picture is the same at every look."""
        wide, high = (math.tan(0.5 * angle) for angle in self.view)
        left, up = np.meshgrid(np.linspace(wide, -wide, self.columns), np.linspace(high, -high, self.rows))
        rays = np.stack([np.ones_like(left), left, up], axis=-1).reshape(-1, 3)
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


@dataclass(frozen=True, kw_only=True)
class Lidar(RangeSensor):
    """A spinning lidar of ``beams`` between the elevations ``fan`` (lowest, highest) [rad].

    A turn has ``steps`` shots of all beams and is looked at in ``sectors`` looks, one after the other, while the rover
    goes on. The defaults are 10 turns a second of 16 beams, most of them downwards as on ground robots. Its noise is
    1 cm near by, and 3 cm at 15 m.
    """

    position_b: tuple[float, float, float] = (0.0, 0.0, 0.8)
    pitch: float = 0.0
    nearest: float = 0.5
    farthest: float = 15.0
    noise: RangeNoise = RangeNoise(constant=0.01, quadratic=0.0001)
    rate: float = 40.0
    beams: int = 16
    fan: tuple[float, float] = (math.radians(-30.0), math.radians(10.0))
    steps: int = 360
    sectors: int = 4

    def directions_s(self, look: int) -> FloatArray:
        """The sector of a turn that look falls into."""
        shots = np.arange(look * self.steps // self.sectors, (look + 1) * self.steps // self.sectors)
        azimuth, rise = np.meshgrid(shots * (2.0 * math.pi / self.steps), np.linspace(*self.fan, self.beams))
        flat = np.cos(rise)
        return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(rise)], axis=-1).reshape(-1, 3)


class Scan(NamedTuple):
    """The returns of one look, in the body: where the rays start (3,) [m], their unit directions (N, 3), the measured
    ranges (N,) [m] and the standard deviations (N,) [m] that the sensor gives for them.

    It only knows what it measured, so a range measured too short counts for more than it should, and a flat ray's noise
    chooses the place that it seems to hit: as in the field, errors of a map are larger than deviations alone make them.
    """

    start_b: FloatArray
    directions_b: FloatArray
    ranges: FloatArray
    deviations: FloatArray

    @property
    def points_b(self) -> FloatArray:
        """What was hit (N, 3) [m]."""
        return self.start_b + self.directions_b * self.ranges[:, None]


def scan(sensor: RangeSensor, ground: Surface, pose: Pose, look: int, rng: np.random.Generator) -> Scan:
    """What the sensor measures of the true ground from the rover's true pose."""
    directions_b, start_b = sensor.directions_b(look), np.array(sensor.position_b)
    start_w = pose.position + pose.rotation @ start_b
    true = cast_rays(ground, start_w, directions_b @ pose.rotation.T, sensor.farthest)
    returned = true >= sensor.nearest
    ranges = true[returned] + rng.normal(size=int(returned.sum())) * sensor.noise.deviation(true[returned])
    return Scan(start_b, directions_b[returned], ranges, sensor.noise.deviation(ranges))
