"""Sensors of ranges: the directions of their rays, and their noise. Without ROS."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray


@dataclass(frozen=True, kw_only=True)
class RangeSensor(ABC):
    """A sensor of ranges on a body.

    ``position_b`` (x, y, z) [m] in the body's frame. The sensor looks along x, ``pitch`` [rad] downwards. ``nearest``
    and ``farthest`` [m]: closer and farther surfaces give no return. ``rate`` [Hz]: of looks.

    The noise of a range r is normal with standard deviation ``noise_constant`` [m] + ``noise_quadratic`` [1/m] x r^2.
    The first part comes from the clock or the lens, the second from triangulation and from weak echoes. By default it
    is 1 cm near by, and 3 cm at 15 m.
    """

    position_b: tuple[float, float, float] = (0.0, 0.0, 0.8)
    pitch: float = 0.0
    nearest: float = 0.5
    farthest: float = 15.0
    noise_constant: float = 0.01
    noise_quadratic: float = 0.0001
    rate: float = 10.0

    @abstractmethod
    def directions_s(self, look: int) -> FloatArray:
        """Return unit directions (N, 3) of the rays of the look of that number: x forwards, z up."""

    def directions_b(self, look: int) -> FloatArray:
        """Return the directions in the body's frame."""
        cos, sin = math.cos(self.pitch), math.sin(self.pitch)
        rotation = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        return np.asarray(self.directions_s(look) @ rotation.T)


@dataclass(frozen=True, kw_only=True)
class DepthCamera(RangeSensor):
    """A stereo camera: a pinhole of ``columns`` x ``rows`` rays over ``view`` (horizontal, vertical) [rad].

    The defaults are a usual short-base camera, thinned out to what a mapper keeps of it.
    """

    columns: int = 64
    rows: int = 48
    view: tuple[float, float] = (math.radians(87.0), math.radians(58.0))

    def directions_s(self, look: int) -> FloatArray:
        """Return the directions row by row from the upper left, the same at every look."""
        wide, high = (math.tan(0.5 * angle) for angle in self.view)
        left, up = np.meshgrid(np.linspace(wide, -wide, self.columns), np.linspace(high, -high, self.rows))
        rays = np.stack([np.ones_like(left), left, up], axis=-1).reshape(-1, 3)
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


@dataclass(frozen=True, kw_only=True)
class Lidar(RangeSensor):
    """A spinning lidar of ``beams`` between the elevations ``fan`` (lowest, highest) [rad].

    A turn has ``steps`` shots of all beams, and consists of ``sectors`` looks, one after the other. By default most
    beams look downwards, as on ground robots.
    """

    beams: int = 16
    fan: tuple[float, float] = (math.radians(-30.0), math.radians(10.0))
    steps: int = 360
    sectors: int = 4

    def directions_s(self, look: int) -> FloatArray:
        """Return the directions of the sector of that look, beam by beam from the lowest."""
        shots = np.arange(look * self.steps // self.sectors, (look + 1) * self.steps // self.sectors)
        azimuth, rise = np.meshgrid(shots * (2.0 * math.pi / self.steps), np.linspace(*self.fan, self.beams))
        flat = np.cos(rise)
        return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(rise)], axis=-1).reshape(-1, 3)
