"""Bases that drive: a forward speed and an angular velocity become speeds of wheels or tracks and steering angles, and
what these do becomes odometry."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.ground.quaternions import Z, about
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.world.base_config import BaseConfig
from smartmesh_ros.world.base_geometry import BaseGeometry, geometry_of
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.world import World

# Speed below which a base that is steered keeps its steering angles [m/s].
STANDSTILL = 1e-6


class BaseOdometry(NamedTuple):
    """Dead reckoning of a base from its wheels or tracks, in a frame that was the root link's at the start.

    ``x``, ``y`` [m] and ``yaw`` [rad], which is not wrapped: pose of the root link; ``linear``, ``side`` [m/s] and
    ``angular`` [rad/s]: its velocities forward, to the left, and about z.
    """

    x: float
    y: float
    yaw: float
    linear: float
    side: float
    angular: float

    @property
    def pose(self) -> Transform:
        """The pose of the root link."""
        return Transform((self.x, self.y, 0.0), about(Z, self.yaw))


class BaseMemory(NamedTuple):
    """Command and odometry of a base.

    ``linear`` [m/s], ``turn`` [rad/s] or, of a base with steering, [1/m]: the command; ``linear_now``, ``turn_now``:
    what the wheels are driven at. ``lasts`` [s]: duration of a command; ``end`` [s]: time at which this one ends.
    ``x``, ``y`` [m], ``yaw`` [rad]: pose of the axle; ``speed`` [m/s], ``angular`` [rad/s]: its measured velocities.
    """

    linear: float
    turn: float
    linear_now: float
    turn_now: float
    lasts: float
    end: float
    x: float
    y: float
    yaw: float
    speed: float
    angular: float


class Base:
    """Drives the robot ``name`` of a world in each step, from its creation until `close`. The robot may come and go.
    Its wheels or tracks are held until it is told to drive. What does not fit the robot is said once.

    Without slip on level ground the robot drives as told. A robot that has wheels behind one another and no steering
    slips aside in turns; see `BaseConfig.track`.
    """

    # Forward speed [m/s], and angular velocity [rad/s] or, of a base with steering, curvature [1/m].
    _target: tuple[float, float]
    _now: tuple[float, float]
    _time: float  # of the world after the last step [s]
    _pose: tuple[float, float, float]  # of the axle, as of odometry
    _velocity: tuple[float, float]  # measured [m/s, rad/s]

    def __init__(self, world: World, name: str, config: BaseConfig) -> None:
        require(isinstance(config, BaseConfig), "base", "the config of a base", config, "BaseConfig(...)")
        self.name, self.config = name, config
        self._world = world
        self._body: Body | None = None  # that `_geometry` is of
        self._geometry: BaseGeometry | None = None
        self._error: InputError | None = None  # why there is none
        self._stand()
        self._start()
        world.watchers.append(self)

    def close(self) -> None:
        """Drive no more; the last commands stay in force."""
        if self in self._world.watchers:
            self._world.watchers.remove(self)

    def drive(self, linear: float, angular: float, lasts: float = math.inf) -> None:
        """Drive at ``linear`` [m/s] forward and ``angular`` [rad/s] to the left from the next step on, and stop after
        ``lasts`` [s] unless the next call comes before. A base with steering that stands does not turn.

        Beyond its limits, the base turns as tightly as it can, and is slower on the same path. Raises `InputError` if
        the robot is not there, cannot drive so, or a number is not finite.
        """
        if not (math.isfinite(as_float(linear)) and math.isfinite(as_float(angular))):
            raise InputError("non_finite", f"a base cannot drive at {linear} m/s and {angular} rad/s: not finite")
        require(as_float(lasts) >= 0.0, "base", "the duration of a command", lasts, "zero or more [s]")
        self._note_time()
        geometry = self._find()
        if geometry is None:
            raise self._error or InputError("unknown_body", f"there is no robot {self.name!r}")
        config = self.config
        linear = min(max(linear, -config.linear_limit), config.linear_limit)
        turn = min(max(angular, -config.angular_limit), config.angular_limit)
        if geometry.steering:
            turn = geometry.within(turn / linear) if abs(linear) > STANDSTILL else self._now[1]
        share = 1.0 / max(1.0, float(np.max(np.abs(geometry.speeds(linear, turn)) / geometry.limit)))
        self._target = linear * share, turn if geometry.steering else turn * share
        self._lasts, self._end, self._fresh = lasts, self._world.time + lasts, True

    def before_step(self) -> None:
        """Command wheels or tracks and steering joints for a step."""
        self._note_time()
        geometry, world = self._find(), self._world
        if geometry is None:
            return
        if world.time >= self._end:
            self._target, self._end = (0.0, self._now[1] if geometry.steering else 0.0), math.inf
            world.say(f"no command came for the base {self.name!r} in time: it stops")
        (linear, turn), config = self._target, self.config
        now = (
            _towards(self._now[0], linear, config.linear_acceleration * world.dt),
            _towards(self._now[1], turn, config.angular_acceleration * world.dt),
        )
        if not self._fresh and now == self._now:
            return
        self._now, self._fresh = now, False
        try:
            self._command(geometry)
        except InputError as error:  # PyBullet's own colliders drive no tracks
            self._refuse(error)

    def after_step(self) -> None:
        """Add the way of a step to the odometry."""
        world, geometry = self._world, self._geometry
        self._time = world.time
        if geometry is None or world.bodies.get(self.name) is not self._body:
            return
        linear, angular = self._velocity = self._measured(geometry)
        x, y, yaw = self._pose
        halfway = yaw + 0.5 * angular * world.dt
        x, y = x + linear * math.cos(halfway) * world.dt, y + linear * math.sin(halfway) * world.dt
        self._pose = x, y, yaw + angular * world.dt

    @property
    def memory(self) -> BaseMemory:
        """The command and the odometry, for `recall`."""
        return BaseMemory(*self._target, *self._now, self._lasts, self._end, *self._pose, *self._velocity)

    def recall(self, memory: BaseMemory) -> None:
        """Go on at the world's time from the memory of a base."""
        self._target, self._now = (memory.linear, memory.turn), (memory.linear_now, memory.turn_now)
        self._lasts, self._end, self._fresh = memory.lasts, memory.end, True
        self._time, self._pose = self._world.time, (memory.x, memory.y, memory.yaw)
        self._velocity = memory.speed, memory.angular

    def start_over(self) -> None:
        """Forget all commands, and start the odometry anew."""
        self._stand()
        self._start()

    @property
    def odometry(self) -> BaseOdometry:
        """The odometry after the last step."""
        (x, y, yaw), (linear, angular) = self._pose, self._velocity
        axle = 0.0 if self._geometry is None else self._geometry.axle
        x, y = x + axle * (1.0 - math.cos(yaw)), y - axle * math.sin(yaw)
        return BaseOdometry(x, y, yaw, linear, -angular * axle, angular)

    def _command(self, geometry: BaseGeometry) -> None:
        """Command the joints and surfaces of the robot."""
        linear, turn = self._now
        for joint, angle in zip(geometry.steering, geometry.angles(turn), strict=True):
            self._world.command(self.name, joint.name, JointCommand(position=joint.sign * angle))
        for name, speed in zip(geometry.names, geometry.speeds(linear, turn).tolist(), strict=True):
            self._world.command(self.name, name, JointCommand(velocity=speed), self._lasts)

    def _measured(self, geometry: BaseGeometry) -> tuple[float, float]:
        """Return the forward speed [m/s] and the angular velocity [rad/s] that the wheels and steering joints tell."""
        if self.config.tracks:  # their speeds are those commanded
            return self._now
        client, joints = self._world.client, self._body.joints if self._body else {}
        uid = self._body.uid if self._body else -1
        states = client.getJointStates(uid, [joints[name] for name in geometry.names])
        speeds = np.array([state[1] for state in states]) / geometry.scale
        if not geometry.steering:
            linear, angular = (geometry.inverse @ speeds).tolist()
            return linear, angular
        states = client.getJointStates(uid, [joints[joint.name] for joint in geometry.steering])
        angles = [joint.sign * state[0] for joint, state in zip(geometry.steering, states, strict=True)]
        curvature = geometry.curvature(angles)
        way = geometry.ways(angles) @ (1.0, curvature)
        linear = float(way @ speeds / (way @ way))
        return linear, curvature * linear

    def _find(self) -> BaseGeometry | None:
        """Return the geometry of the robot that is there now, None if there is none that can drive so."""
        body = self._world.bodies.get(self.name)
        if body is not self._body:
            self._body, self._geometry, self._error, self._fresh = body, None, None, True
            if body is None:
                self._stand()
                return None
            try:
                self._geometry = geometry_of(self._world.client, body, self.config)
            except InputError as error:
                self._refuse(error)
        return self._geometry

    def _refuse(self, error: InputError) -> None:
        """Drive no more until there is another robot, and say why."""
        self._geometry, self._error = None, error
        self._world.say(f"the base {self.name!r} does not drive: {error}")

    def _stand(self) -> None:
        """Forget all commands."""
        self._target, self._now = (0.0, 0.0), (0.0, 0.0)
        self._lasts, self._end, self._fresh = math.inf, math.inf, True

    def _note_time(self) -> None:
        """If the world's time was reset, let the last command end as much earlier, and start the odometry anew."""
        if self._world.time < self._time:
            self._end += self._world.time - self._time
            self._start()

    def _start(self) -> None:
        """Start the odometry anew."""
        self._time, self._pose, self._velocity = -math.inf, (0.0, 0.0, 0.0), (0.0, 0.0)


def _towards(value: float, target: float, most: float) -> float:
    """Return a value after a change towards a target by ``most``."""
    return min(max(target, value - most), value + most)
