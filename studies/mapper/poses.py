"""Where the rover is, and the way it drives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.distance import Surface

# Between the rover's wheels, along it and across it [m].
WHEELBASE, TRACK = 0.8, 0.6


class Pose(NamedTuple):
    """Position [m] and roll, pitch and yaw [rad], turned about x, then y, then z."""

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float

    @property
    def position(self) -> FloatArray:
        """(3,) [m]."""
        return np.array([self.x, self.y, self.z])

    @property
    def rotation(self) -> FloatArray:
        """From the body to the world, (3, 3)."""
        (cr, sr), (cp, sp), (cy, sy) = (
            (math.cos(angle), math.sin(angle)) for angle in (self.roll, self.pitch, self.yaw)
        )
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(about_z @ about_y @ about_x)


@dataclass(frozen=True, kw_only=True)
class LoopPath:
    """An ellipse around ``centre`` (x, y) [m] with ``radii`` along x and y [m], at ``speed`` [m/s] on average.

    By default a lap of 31 m takes half a minute, at the pace of a rover off the road, and ends where it began, so that
    loops can be closed.
    """

    centre: tuple[float, float] = (0.0, 0.0)
    radii: tuple[float, float] = (6.0, 4.0)
    speed: float = 1.0

    def at(self, time: float) -> tuple[float, float, float]:
        """Position (x, y) [m] and heading [rad]."""
        (x, y), (a, b) = self.centre, self.radii
        angle = self.speed * time / (0.5 * (a + b))
        cos, sin = math.cos(angle), math.sin(angle)
        return x + a * cos, y + b * sin, math.atan2(b * cos, -a * sin)


def on_ground(ground: Surface, x: float, y: float, yaw: float) -> Pose:
    """The rover on the ground: its origin between its four wheels' footprints. Raises `InputError` off the ground."""
    along, across = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    wheels = np.zeros((4, 3))
    wheels[:, :2] = np.array([x, y]) + 0.5 * (WHEELBASE * signs[:, :1] * along + TRACK * signs[:, 1:] * across)
    heights = ground.below(wheels)
    if np.isnan(heights).any():
        raise InputError("path", f"the rover at ({x:g}, {y:g}) m is not wholly on the true ground")
    rise, lean = signs.T @ heights / 2.0
    return Pose(x, y, float(heights.mean()), math.atan2(lean, TRACK), -math.atan2(rise, WHEELBASE), yaw)
