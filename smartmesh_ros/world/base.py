"""Bases that drive: a forward speed and an angular velocity become speeds of wheels or tracks and steering angles, and
what these do becomes odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError, as_float, require, require_body_name
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


@dataclass
class BaseMemory:
    """Command and odometry of a base.

    ``linear`` [m/s], ``turn`` [rad/s] or, of a base with steering, [1/m]: the command; ``linear_now``, ``turn_now``:
    what the wheels are driven at. ``lasts`` [s]: duration of a command; ``end`` [s]: time at which this one ends.
    ``x``, ``y`` [m], ``yaw`` [rad]: pose of the axle; ``speed`` [m/s], ``angular`` [rad/s]: its measured velocities.
    """

    linear: float = 0.0
    turn: float = 0.0
    linear_now: float = 0.0
    turn_now: float = 0.0
    lasts: float = math.inf
    end: float = math.inf
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    speed: float = 0.0
    angular: float = 0.0

    def stand(self) -> None:
        """Forget all commands."""
        self.linear = self.turn = self.linear_now = self.turn_now = 0.0
        self.lasts = self.end = math.inf

    def start(self) -> None:
        """Start the odometry anew."""
        self.x = self.y = self.yaw = self.speed = self.angular = 0.0


class Base:
    """Drives the robot ``name`` of a world in each step, from its creation until `close`. The robot may come and go.
    Its wheels or tracks are held until it is told to drive. What does not fit the robot is said once. A second base of
    a name is refused, because the two would command the same wheels.

    Without slip on level ground the robot drives as told. A robot that has wheels behind one another and no steering
    slips aside in turns; see `BaseConfig.track`. ``memory``: the command and the odometry, for `recall`.
    """

    def __init__(self, world: World, name: str, config: BaseConfig) -> None:
        require(isinstance(world, World), "base", "the world of a base", world, "a World")
        require(isinstance(config, BaseConfig), "base", "the config of a base", config, "BaseConfig(...)")
        require_body_name(name)
        self.name, self.config = name, config
        if any(isinstance(other, Base) and other.name == name for other in world.watchers):
            raise InputError("base", f"a base drives {name!r} already, also one that comes anew; close() that base")
        self._world = world
        self._body: Body | None = None  # that `_geometry` is of
        self._geometry: BaseGeometry | None = None
        self._error: InputError | None = None  # why there is none
        self.start_over()
        world.watchers.append(self)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the base is made of, which drives the robot of the copied world."""
        made_of = {"world": self._world, "name": self.name, "config": self.config}
        return {"made_of": made_of, "memory": self.memory, "drives": self in self._world.watchers}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the base of such a state."""
        Base.__init__(self, **state["made_of"])
        self.recall(state["memory"])
        self._find()
        if not state["drives"]:
            self.close()

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
        geometry, memory = self._find(), self.memory
        if geometry is None:
            raise self._error or InputError("unknown_body", f"there is no robot {self.name!r}")
        config = self.config
        linear = min(max(linear, -config.linear_limit), config.linear_limit)
        turn = min(max(angular, -config.angular_limit), config.angular_limit)
        if geometry.steering:
            turn = geometry.within(turn / linear) if abs(linear) > STANDSTILL else memory.turn_now
        share = 1.0 / max(1.0, float(np.max(np.abs(geometry.speeds(linear, turn)) / geometry.limit)))
        memory.linear, memory.turn = linear * share, turn if geometry.steering else turn * share
        memory.lasts, memory.end, self._fresh = lasts, self._world.time + lasts, True

    def before_step(self) -> None:
        """Command wheels or tracks and steering joints for a step."""
        self._note_time()
        geometry, world, memory = self._find(), self._world, self.memory
        if geometry is None:
            return
        if world.time >= memory.end:
            memory.linear, memory.turn = 0.0, memory.turn_now if geometry.steering else 0.0
            memory.end = math.inf
            world.say(f"no command came for the base {self.name!r} in time: it stops")
        before = memory.linear_now, memory.turn_now
        memory.linear_now = _towards(before[0], memory.linear, self.config.linear_acceleration * world.dt)
        memory.turn_now = _towards(before[1], memory.turn, self.config.angular_acceleration * world.dt)
        if not self._fresh and (memory.linear_now, memory.turn_now) == before:
            return
        self._fresh = False
        try:
            self._command(geometry)
        except InputError as error:  # PyBullet's own colliders drive no tracks
            self._refuse(error)

    def after_step(self) -> None:
        """Add the way of a step to the odometry."""
        world, geometry, memory = self._world, self._geometry, self.memory
        self._time = world.time
        if geometry is None or world.bodies.get(self.name) is not self._body:
            return
        memory.speed, memory.angular = self._measured(geometry)
        halfway = memory.yaw + 0.5 * memory.angular * world.dt
        memory.x += memory.speed * math.cos(halfway) * world.dt
        memory.y += memory.speed * math.sin(halfway) * world.dt
        memory.yaw += memory.angular * world.dt

    def recall(self, memory: BaseMemory) -> None:
        """Go on at the world's time from the memory of a base."""
        self.memory, self._time, self._fresh = replace(memory), self._world.time, True

    def start_over(self) -> None:
        """Forget all commands, and start the odometry anew."""
        self.memory, self._fresh = BaseMemory(), True
        self._time = -math.inf  # of the world after the last step [s]

    @property
    def odometry(self) -> BaseOdometry:
        """The odometry after the last step."""
        it, axle = self.memory, 0.0 if self._geometry is None else self._geometry.axle
        x, y = it.x + axle * (1.0 - math.cos(it.yaw)), it.y - axle * math.sin(it.yaw)
        return BaseOdometry(x, y, it.yaw, it.speed, -it.angular * axle, it.angular)

    def _command(self, geometry: BaseGeometry) -> None:
        """Command the joints and surfaces of the robot."""
        linear, turn = self.memory.linear_now, self.memory.turn_now
        for joint, angle in zip(geometry.steering, geometry.angles(turn), strict=True):
            self._world.command(self.name, joint.name, JointCommand(position=joint.sign * angle))
        for name, speed in zip(geometry.names, geometry.speeds(linear, turn).tolist(), strict=True):
            self._world.command(self.name, name, JointCommand(velocity=speed), self.memory.lasts)

    def _measured(self, geometry: BaseGeometry) -> tuple[float, float]:
        """Return the forward speed [m/s] and the angular velocity [rad/s] that the wheels and steering joints tell."""
        if self.config.tracks:  # their speeds are those commanded
            return self.memory.linear_now, self.memory.turn_now
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
                self.memory.stand()
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

    def _note_time(self) -> None:
        """If the world's time was reset, let the last command end as much earlier, and start the odometry anew."""
        if self._world.time < self._time:
            self.memory.end += self._world.time - self._time
            self.memory.start()
            self._time = -math.inf


def _towards(value: float, target: float, most: float) -> float:
    """Return a value after a change towards a target by ``most``."""
    return min(max(target, value - most), value + most)
