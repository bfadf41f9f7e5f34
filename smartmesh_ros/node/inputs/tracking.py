"""Velocities and time-outs of tracked bodies, whose poses come from messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from smartmesh_ros.physics.limits import FASTEST, FASTEST_SPIN
from smartmesh_ros.physics.state import BodyState, Quaternion, Vector
from smartmesh_ros.physics.world import World
from smartmesh_ros.terrain.grid import FloatArray

# Longest time between two poses from which velocity is estimated; a body without a pose for so long stops [s].
MAX_INTERVAL = 0.5


@dataclass
class _LastPose:
    state: BodyState
    time: float
    moving: bool


class Tracking:
    """Feeds poses of tracked bodies into a world. Estimates velocities from successive poses if a message has none."""

    def __init__(self, world: World, timeout: float) -> None:
        self.timeout = timeout
        self._world = world
        self._last_poses: dict[str, _LastPose] = {}

    @property
    def names(self) -> list[str]:
        """Names of the tracked bodies."""
        return list(self._last_poses)

    def update(self, name: str, radius: float, state: BodyState, time: float) -> None:
        """Sets the state of ``name`` at ``time`` [s], on any clock that is the same for all poses of this body."""
        last = self._last_poses.get(name)
        tracked = state
        if last is not None and not any(state.linear) and not any(state.angular):
            interval = time - last.time
            if 0.0 < interval <= MAX_INTERVAL:
                linear, angular = _velocity(last.state, state, interval)
                if max(map(abs, linear)) <= FASTEST and max(map(abs, angular)) <= FASTEST_SPIN:  # else the body jumped
                    tracked = replace(state, linear=linear, angular=angular)
        self._world.track(name, radius, tracked)
        self._last_poses[name] = _LastPose(state, time, any(tracked.linear) or any(tracked.angular))

    def forget(self, name: str) -> None:
        """Removes a tracked body."""
        if self._last_poses.pop(name, None) is not None and name in self._world.bodies:
            self._world.remove(name)

    def expire(self, time: float) -> list[str]:
        """Removes the bodies without a pose for the time-out, and returns their names. Stops bodies without a pose for
        `MAX_INTERVAL`."""
        for name, seen in self._last_poses.items():
            if seen.moving and time - seen.time > MAX_INTERVAL and name in self._world.bodies:
                state = self._world.state(name)
                self._world.track(name, self._world.bodies[name].radius, BodyState(state.position, state.orientation))
                seen.moving = False
        gone = [name for name, seen in self._last_poses.items() if time - seen.time > self.timeout]
        for name in gone:
            self.forget(name)
        return gone


def _velocity(before: BodyState, after: BodyState, interval: float) -> tuple[Vector, Vector]:
    """Return mean linear [m/s] and angular [rad/s] velocity between two poses ``interval`` [s] apart."""
    linear = (np.array(after.position) - np.array(before.position)) / interval
    angular = _rotation_between(before.orientation, after.orientation) / interval
    return tuple(linear.tolist()), tuple(angular.tolist())


def _rotation_between(first: Quaternion, second: Quaternion) -> FloatArray:
    """Return the rotation vector [rad] from the first to the second orientation, in the fixed frame."""
    x1, y1, z1, w1 = first
    x2, y2, z2, w2 = second
    # The second quaternion times the conjugate of the first.
    vector = np.array(
        [
            -w2 * x1 + x2 * w1 - y2 * z1 + z2 * y1,
            -w2 * y1 + x2 * z1 + y2 * w1 - z2 * x1,
            -w2 * z1 - x2 * y1 + y2 * x1 + z2 * w1,
        ]
    )
    scalar = w2 * w1 + x2 * x1 + y2 * y1 + z2 * z1
    if scalar < 0.0:
        vector, scalar = -vector, -scalar
    length = float(np.linalg.norm(vector))
    return vector * (2.0 * math.atan2(length, scalar) / length) if length > 1e-12 else np.zeros(3)
