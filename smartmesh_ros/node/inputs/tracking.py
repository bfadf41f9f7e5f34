"""Velocities and time-outs of tracked bodies, whose poses come from messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from smartmesh_ros.ground.limits import FASTEST, FASTEST_SPIN
from smartmesh_ros.ground.quaternions import conjugate, product, rotation_vector
from smartmesh_ros.ground.shapes import Solid
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.world import World

# Longest time between two poses from which velocity is estimated; a body without a pose for so long stops [s].
MAX_INTERVAL = 0.5
# Square of a velocity that counts as zero [m^2/s^2, rad^2/s^2].
TINY = 1e-300


@dataclass
class _LastPose:
    """``tracked``: the state with its velocity, with which the body moves on. ``time`` [s]: of the pose. ``heard`` [s]:
    of its arrival. ``stated``: the source states velocities. ``change``: mean velocity since the pose before (2, 3),
    linear [m/s] and angular [rad/s], None = unknown."""

    tracked: BodyState
    time: float
    heard: float
    stated: bool
    change: FloatArray | None

    @property
    def moving(self) -> bool:
        """True if the body moves on until its next pose."""
        return any(self.tracked.linear) or any(self.tracked.angular)


class Tracking:
    """Feeds poses of tracked bodies into a world, and estimates velocities from successive poses if none are stated.

    ``timeout`` [s]: bodies are removed after this long without a pose. ``max_velocity`` [m/s]: poses that change faster
    have jumped. A jump gives no velocity, nor does any single change that the change before does not confirm: else a
    correction of a standing body's pose would push what the body does not touch.
    """

    def __init__(self, world: World, timeout: float, max_velocity: float = FASTEST) -> None:
        self.timeout, self.max_velocity = timeout, max_velocity
        self._world = world
        self._last_poses: dict[str, _LastPose] = {}

    @property
    def names(self) -> list[str]:
        return list(self._last_poses)

    def update(
        self,
        name: str,
        shape: Solid | float,
        state: BodyState,
        time: float,
        heard: float | None = None,
        *,
        stated: bool = False,
    ) -> str:
        """Set the state of ``name`` at ``time`` [s], on any clock that is the same for all poses of this body; return
        what is wrong with the change of its pose, empty = nothing.

        ``shape``: or the radius of a sphere [m]. ``heard`` [s]: time of arrival on the clock of `expire`, None =
        ``time``. ``stated``: the source states velocities, also that of a body at rest. A source that stated a velocity
        before does so too.
        """
        last = self._last_poses.get(name)
        stated |= any(state.linear) or any(state.angular) or (last is not None and last.stated)
        tracked, change, jump = state, None, ""
        if last is not None and not stated and time == last.time:
            tracked, change = replace(last.tracked, position=state.position, orientation=state.orientation), last.change
        elif last is not None and not stated and 0.0 < time - last.time <= MAX_INTERVAL:
            change = _velocity(last.tracked, state, time - last.time)
            linear, angular = np.linalg.norm(change, axis=1).tolist()
            radius = shape if isinstance(shape, int | float) else shape.bounding_radius
            speed = max(linear, radius * angular)
            if speed > self.max_velocity or angular > FASTEST_SPIN:
                change, distance = last.change, math.dist(last.tracked.position, state.position)
                jump = (
                    f"the pose of {name!r} jumped by {distance:.3g} m, which is {speed:.3g} m/s at its surface; "
                    f"velocities are estimated up to bodies.max_velocity = {self.max_velocity:g} m/s"
                )
            else:
                tracked = _with_velocity(state, change, last.change)
        self._world.track(name, shape, tracked)
        self._last_poses[name] = _LastPose(tracked, time, time if heard is None else heard, stated, change)
        return jump

    def restart(self, time: float) -> None:
        """Go on at ``time`` [s] of a clock that was set: all bodies count as heard now."""
        for seen in self._last_poses.values():
            seen.time, seen.heard, seen.change = -math.inf, time, None

    def take(self, time: float) -> None:
        """Take the tracked bodies that the world has now, as of a saved state, for heard at ``time`` [s]."""
        tracked = [body.name for body in self._world.bodies.values() if body.tracked]
        self._last_poses = {name: _LastPose(self._world.state(name), -math.inf, time, False, None) for name in tracked}

    def forget(self, name: str) -> None:
        if name in self._last_poses and name in self._world.bodies:
            self._world.remove(name)
        self._last_poses.pop(name, None)  # once it is gone: a removal that failed is made again

    def expire(self, time: float) -> list[str]:
        """Removes the bodies without a pose for the time-out, and returns their names. Stops bodies without a pose for
        `MAX_INTERVAL`."""
        for name, seen in self._last_poses.items():
            if seen.moving and time - seen.heard > MAX_INTERVAL and name in self._world.bodies:
                state, body = self._world.state(name), self._world.bodies[name]
                self._world.track(name, body.shape or body.radius, BodyState(state.position, state.orientation))
                seen.tracked = BodyState(seen.tracked.position, seen.tracked.orientation)
        gone = [name for name, seen in self._last_poses.items() if time - seen.heard > self.timeout]
        for name in gone:
            self.forget(name)
        return gone


def _velocity(before: BodyState, after: BodyState, interval: float) -> FloatArray:
    """Return the mean velocity (2, 3), linear and angular, between two poses ``interval`` [s] apart."""
    way = np.array(after.position) - np.array(before.position)
    turn = rotation_vector(product(after.orientation, conjugate(before.orientation)))
    return np.stack([way, np.array(turn)]) / interval


def _with_velocity(state: BodyState, change: FloatArray, before: FloatArray | None) -> BodyState:
    """Return a state with the velocity of the last change of pose, reduced to what the change ``before`` confirms."""
    if before is not None:  # shortened to the component of the one before along it
        squares = np.maximum((change * change).sum(axis=1), TINY)
        change = change * np.clip((change * before).sum(axis=1) / squares, 0.0, 1.0)[:, None]
    linear, angular = change.tolist()
    return replace(state, linear=tuple(linear), angular=tuple(angular))
