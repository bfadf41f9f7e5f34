"""Drift of the rover's pose estimate, and its correction by loop closures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray
from studies.mapper.poses import Pose


@dataclass(frozen=True, kw_only=True)
class DriftConfig:
    """A random walk of the estimated pose; roll and pitch are known from gravity.

    ``horizontal`` and ``vertical`` [m] and ``yaw`` [rad]: standard deviation after one second; after t seconds it is
    sqrt(t) times that. By default 4 cm and 3 cm after 15 s, as of good odometry at walking pace. ``closures`` [s]: when
    a loop is closed. ``residual`` [-]: the share of the error that a closure leaves.
    """

    horizontal: float = 0.01
    vertical: float = 0.008
    yaw: float = 0.001
    closures: tuple[float, ...] = (15.0, 30.0, 45.0)
    residual: float = 0.1

    def __post_init__(self) -> None:
        if min(self.horizontal, self.vertical, self.yaw) < 0.0 or not 0.0 <= self.residual <= 1.0:
            raise InputError("parameter", f"{self}: drift must be at least zero, and the residual 0 to 1")

    def closes(self, since: float, until: float) -> bool:
        """Whether a loop is closed after ``since`` and not after ``until`` [s]."""
        return any(since < time <= until for time in self.closures)


NO_DRIFT = DriftConfig(horizontal=0.0, vertical=0.0, yaw=0.0, closures=())


class Estimator:
    """Estimates the rover's pose with an ``error`` (4,) in x, y, z [m] and yaw [rad]."""

    def __init__(self, config: DriftConfig, rng: np.random.Generator) -> None:
        self.config = config
        self.error: FloatArray = np.zeros(4)
        self._rng = rng

    def wait(self, seconds: float) -> None:
        """Lets the error walk on."""
        config = self.config
        deviations = np.array([config.horizontal, config.horizontal, config.vertical, config.yaw])
        self.error = self.error + deviations * math.sqrt(seconds) * self._rng.normal(size=4)

    def estimate(self, true: Pose) -> Pose:
        """Return the estimated pose."""
        x, y, z, yaw = self.error.tolist()
        return true._replace(x=true.x + x, y=true.y + y, z=true.z + z, yaw=true.yaw + yaw)

    def close_loop(self) -> None:
        """Reduce the error as after a loop closure."""
        self.error = self.error * self.config.residual
