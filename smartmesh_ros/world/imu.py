"""Inertial measurement units: mean specific force and angular velocity of a body or link over the steps of a world."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError, checked_count, is_number, require, require_body_name
from smartmesh_ros.ground.quaternions import conjugate, product, rotate, rotation_vector, slerp
from smartmesh_ros.ground.state import BodyState, Quaternion, Vector
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import frame_state, link_index
from smartmesh_ros.world.world import World

# Largest magnitude of a bias, a noise density or a random walk, in its unit.
LARGEST = 1e6
# Bounds of the rate [Hz].
RATES = (0.01, 10_000.0)
# Readings that are kept until they are taken.
MOST_KEPT = 10_000


@dataclass(frozen=True, kw_only=True)
class ImuConfig:
    """Settings of an IMU; the names of those of its noise are Kalibr's.

    ``rate`` [Hz] of readings in simulated time, at most one a step. Of the accelerometer [m/s^2] and the gyroscope
    [rad/s]: ``*_noise_density`` of white noise, per square root of a hertz; ``*_random_walk`` of the bias, the same per
    second; ``*_bias``, the bias at the start, along the axes of the sensor. ``seed``: of the noise, which is the same
    in each run. Raises `InputError` for an impossible value.
    """

    rate: float = 100.0
    accelerometer_noise_density: float = 0.0
    accelerometer_random_walk: float = 0.0
    accelerometer_bias: Vector = (0.0, 0.0, 0.0)
    gyroscope_noise_density: float = 0.0
    gyroscope_random_walk: float = 0.0
    gyroscope_bias: Vector = (0.0, 0.0, 0.0)
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in ((one.name, getattr(self, one.name)) for one in fields(self)):
            if name == "seed":
                object.__setattr__(self, name, checked_count(value, "imu", "seed of an IMU"))
                continue
            if name == "rate":
                possible, wanted = _is_between(value, *RATES), f"{RATES[0]:g} to {RATES[1]:g} Hz"
            elif name.endswith("bias"):
                possible = isinstance(value, list | tuple | np.ndarray) and len(value) == 3
                possible = possible and all(_is_between(one, -LARGEST, LARGEST) for one in value)
                wanted = "three finite numbers"
            else:
                possible, wanted = _is_between(value, 0.0, LARGEST), f"0 to {LARGEST:g}"
            require(possible, "imu", f"{name} of an IMU", value, wanted)
            if name.endswith("bias"):
                object.__setattr__(self, name, tuple(map(float, value)))  # to be compared


def _is_between(value: Any, low: float, high: float) -> bool:
    return is_number(value) and bool(low <= value <= high)


class ImuReading(NamedTuple):
    """A reading at ``time`` [s]: ``orientation`` (x, y, z, w) of the sensor in the terrain's frame then, and means over
    the ``duration`` [s] before: ``angular_velocity`` (3,) [rad/s], and specific force ``acceleration`` (3,) [m/s^2],
    along the axes of the sensor. A sensor at rest measures the opposite of gravity."""

    time: float
    duration: float
    orientation: Quaternion
    angular_velocity: FloatArray
    acceleration: FloatArray


class Imu:
    """Measures in each step of a world, from its creation until `close`.

    ``name``: of a simulated body, or of a robot; ``link``: of the robot, "" = its root link. The sensor is at the
    origin of the link's frame, with its axes; that of a body that is no robot at its centre of mass. Nothing is
    measured while the body or link is not there.

    The specific force of a step is the change of the sensor's velocity in this step, divided by its duration, minus
    gravity, along the axes that the sensor has halfway. The angular velocity is the rotation in the step, divided by
    its duration. So integrals of the readings are the motion, impacts included; a body that is teleported between two
    steps has not accelerated. A reading has the means of all steps since the one before.
    """

    _time: float  # of the world after the last step [s]
    _turn: int  # number of the last reading, by the rate and the world's time
    _before: BodyState | None  # before the step

    def __init__(self, world: World, name: str, link: str = "", config: ImuConfig | None = None) -> None:
        require(isinstance(world, World), "imu", "the world of an IMU", world, "a World")
        config = ImuConfig() if config is None else config
        require(isinstance(config, ImuConfig), "imu", "the config of an IMU", config, "ImuConfig(...)")
        require_body_name(name)
        self.name, self.link, self.config = name, link, config
        self._world = world
        self._body: Body | None = None  # that is measured
        self._link: int | None = None  # its link in PyBullet, -1 = the root, None = there is none
        self._readings: deque[ImuReading] = deque(maxlen=MOST_KEPT)
        self._restart()
        world.watchers.append(self)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the IMU is made of, which measures in the copied world."""
        return {**vars(self), "_body": None, "measures": self in self._world.watchers}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the IMU of such a state."""
        measures = state.pop("measures")
        vars(self).update(state)
        self._body = self._world.bodies.get(self.name)
        if measures:
            self._world.watchers.append(self)

    def close(self) -> None:
        """Measure no more."""
        if self in self._world.watchers:
            self._world.watchers.remove(self)

    def take(self) -> list[ImuReading]:
        """Return the readings since the last call, the newest 10,000 at most."""
        found = [*self._readings]
        self._readings.clear()
        return found

    def start_over(self) -> None:
        """Begin as a new sensor, without readings."""
        self._readings.clear()
        self._restart()

    def before_step(self) -> None:
        """Note the state before a step."""
        self._before = self._state()

    def after_step(self) -> None:
        """Add up what the step did; keep a reading if one is due."""
        world, before, after = self._world, self._before, self._state()
        if world.time < self._time:  # the world's time was reset
            self._restart()
        self._time = world.time
        if before is None or after is None:
            self._forget()
            return
        halfway = conjugate(slerp(before.orientation, after.orientation, 0.5))
        gravity, dt = world.config.physics.gravity, world.dt
        gained = [b - a - g * dt for a, b, g in zip(before.linear, after.linear, gravity, strict=True)]
        turned = rotation_vector(product(after.orientation, conjugate(before.orientation)))
        self._gained += rotate(halfway, (gained[0], gained[1], gained[2]))
        self._turned += rotate(halfway, turned)
        self._duration += dt
        turn = world.periods(self.config.rate)
        if turn != self._turn:
            self._turn = turn
            self._readings.append(self._reading(after))

    def _reading(self, state: BodyState) -> ImuReading:
        """Return the reading of the steps since the last one, with its noise."""
        config, duration = self.config, self._duration
        walk = math.sqrt(duration) * self._random.normal(size=(2, 3))
        noise = self._random.normal(size=(2, 3)) / math.sqrt(duration)
        self._biases += walk * [[config.accelerometer_random_walk], [config.gyroscope_random_walk]]
        errors = self._biases + noise * [[config.accelerometer_noise_density], [config.gyroscope_noise_density]]
        means = np.stack([self._gained, self._turned]) / duration + errors
        self._forget()
        return ImuReading(self._world.time, duration, state.orientation, means[1], means[0])

    def _state(self) -> BodyState | None:
        """Return the state of the sensor, None if it is not there."""
        world = self._world
        body = world.bodies.get(self.name)
        if body is not self._body:
            self._body = body
            self._link = None if body is None else self._index_in(body)
            self._forget()
        if body is None or self._link is None:
            return None
        client = world.client
        if self._link < 0:
            pose, velocity, inertial = client.getBasePositionAndOrientation, client.getBaseVelocity, body.inertial
            found = *pose(body.uid), *velocity(body.uid)
        else:  # PyBullet computes it from the joints anew, which changes no step
            position, turn, *centre, _, _, linear, angular = client.getLinkState(body.uid, self._link, 1, 1)
            found, inertial = (position, turn, linear, angular), Transform(*centre)
        try:
            return frame_state(BodyState(*found), inertial)
        except InputError:  # not finite: a body that the world is about to remove
            return None

    def _index_in(self, body: Body) -> int | None:
        """Return PyBullet's index of the link, None if it has none or the body does not move by physics."""
        if not body.simulated:
            return None
        if not self.link:
            return -1
        return link_index(self._world.client, body.uid, self.link) if body.is_robot else None

    def _restart(self) -> None:
        """Begin as a new sensor."""
        self._time, self._turn = -math.inf, self._world.periods(self.config.rate)
        self._random = np.random.default_rng(self.config.seed)
        self._biases = np.array([self.config.accelerometer_bias, self.config.gyroscope_bias], np.float64)
        self._before = None
        self._forget()

    def _forget(self) -> None:
        """Forget what was measured since the last reading."""
        self._gained, self._turned = np.zeros(3), np.zeros(3)  # along the axes of the sensor [m/s], [rad]
        self._duration = 0.0  # [s]
