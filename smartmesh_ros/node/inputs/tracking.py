"""Velocities and time-outs of bodies whose poses are dictated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from smartmesh_ros.physics.limits import FASTEST, FASTEST_SPIN
from smartmesh_ros.physics.state import BodyState, Quaternion, Vector
from smartmesh_ros.physics.world import World
from smartmesh_ros.terrain.grid import FloatArray

# Poses further apart than this say nothing about velocity, and a body goes no farther without another pose [s].
LONGEST_INTERVAL = 0.5


@dataclass
class _Seen:
    state: BodyState
    time: float
    moving: bool


class Tracking:
    """Feeds dictated poses into a world: velocity from successive poses where none is given, and time-outs."""

    def __init__(self, world: World, timeout: float) -> None:
        self.timeout = timeout
        self._world = world
        self._seen: dict[str, _Seen] = {}

    @property
    def names(self) -> list[str]:
        """Tracked bodies."""
        return list(self._seen)

    def update(self, name: str, radius: float, state: BodyState, time: float) -> None:
        """Takes the pose that ``name`` has at ``time`` [s]; ``time`` is on the caller's clock, and its own only."""
        last = self._seen.get(name)
        dictated = state
        if last is not None and not any(state.linear) and not any(state.angular):
            interval = time - last.time
            if 0.0 < interval <= LONGEST_INTERVAL:
                linear, angular = _velocity(last.state, state, interval)
                if max(map(abs, linear)) <= FASTEST and max(map(abs, angular)) <= FASTEST_SPIN:  # else it has jumped
                    dictated = replace(state, linear=linear, angular=angular)
        self._world.track(name, radius, dictated)
        self._seen[name] = _Seen(state, time, any(dictated.linear) or any(dictated.angular))

    def forget(self, name: str) -> None:
        """Takes a tracked body out of the world."""
        if self._seen.pop(name, None) is not None and name in self._world.bodies:
            self._world.remove(name)

    def expire(self, time: float) -> list[str]:
        """Takes out the bodies that were not heard of for the time-out; returns their names. Those that were not heard
        of for a while, but may still be, stop where they are."""
        for name, seen in self._seen.items():
            if seen.moving and time - seen.time > LONGEST_INTERVAL and name in self._world.bodies:
                state = self._world.state(name)
                self._world.track(name, self._world.bodies[name].radius, BodyState(state.position, state.orientation))
                seen.moving = False
        gone = [name for name, seen in self._seen.items() if time - seen.time > self.timeout]
        for name in gone:
            self.forget(name)
        return gone


def _velocity(before: BodyState, after: BodyState, interval: float) -> tuple[Vector, Vector]:
    """Mean velocity and angular velocity between two poses."""
    linear = (np.array(after.position) - np.array(before.position)) / interval
    angular = _rotation_between(before.orientation, after.orientation) / interval
    return tuple(linear.tolist()), tuple(angular.tolist())


def _rotation_between(first: Quaternion, second: Quaternion) -> FloatArray:
    """Rotation vector [rad] that takes one orientation to the other, in the fixed frame."""
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
