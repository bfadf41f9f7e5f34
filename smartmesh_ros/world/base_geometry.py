"""Where the wheels, tracks and steering joints of a driving base are, read from its robot, and its kinematics.

Lengths are along the axes of the root link with all joints at zero: x forward, y to the left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import product, rotate
from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.base_config import BaseConfig
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import link_index
from smartmesh_ros.world.standing import Underside

# Least part of a wheel's axis along y, and of a steering axis along z, in the frame of the root link.
STRAIGHT = 0.8
# Largest steering angle [rad]; at a right angle the turn has no speed.
STEEPEST = 1.5
# Directions around a wheel's axis in which its radius is measured: the largest is found to 1e-4.
AROUND = 256


class Steering(NamedTuple):
    """A steering joint at ``x``, ``y`` [m]: ``sign`` of its axis along z, and its largest angles to the right and to
    the left [rad], above zero."""

    name: str
    x: float
    y: float
    sign: float
    right: float
    left: float


@dataclass(frozen=True, eq=False)
class BaseGeometry:
    """The n wheels or tracks of a base, by their ``names``.

    ``x``, ``y`` (n,) [m]: places; ``y`` of a base without steering is the effective one of `_turning`. ``scale`` (n,):
    signed ratio of the speed of the joint [rad/s] or surface [m/s] to the speed over ground [m/s]. ``limit`` (n,):
    largest speed of the joint or surface. ``steered`` (n,): index in ``steering`` of the joint that turns a wheel, -1 =
    none. ``axle`` [m]: x of the points about which the base turns."""

    names: tuple[str, ...]
    x: FloatArray
    y: FloatArray
    scale: FloatArray
    limit: FloatArray
    steered: NDArray[np.int64]
    steering: tuple[Steering, ...]
    axle: float

    def angles(self, curvature: float) -> list[float]:
        """Return the angle of each steering joint [rad], to the left, for a path of a curvature [1/m]."""
        return [math.atan2(curvature * (s.x - self.axle), 1.0 - curvature * s.y) for s in self.steering]

    def curvature(self, angles: Sequence[float]) -> float:
        """Return the curvature [1/m] for angles of the steering joints [rad], to the left: their mean."""
        each = []
        for joint, angle in zip(self.steering, angles, strict=True):
            slope = math.tan(min(max(angle, -STEEPEST), STEEPEST))
            across = (joint.x - self.axle) + slope * joint.y
            each.append(slope / across if abs(across) > 1e-9 else 0.0)
        return sum(each) / len(each)

    def within(self, curvature: float) -> float:
        """Return the curvature that the steering joints reach, nearest to one [1/m]."""
        side, largest = math.copysign(1.0, curvature), abs(curvature)
        for joint in self.steering:
            away = joint.x - self.axle
            slope = math.tan(joint.left if side * away > 0.0 else joint.right)
            across = abs(away) + side * slope * joint.y
            if across > 0.0:
                largest = min(largest, slope / across)
        return side * largest

    def speeds(self, linear: float, turn: float) -> FloatArray:
        """Return the speeds (n,) of the joints [rad/s] and surfaces [m/s] for a forward speed [m/s] and an angular
        velocity [rad/s] or, of a base with steering, a curvature [1/m]."""
        angular = turn * linear if self.steering else turn
        return self.scale * (self.ways(self.angles(turn)) @ (linear, angular))

    @cached_property
    def inverse(self) -> FloatArray:
        """Of a base without steering, what makes of the speeds over ground of its wheels [m/s] its forward speed [m/s]
        and angular velocity [rad/s], (2, n): a least-squares fit."""
        return np.asarray(np.linalg.pinv(self.ways([])), np.float64)

    def ways(self, angles: Sequence[float]) -> FloatArray:
        """Return the rows (n, 2) of each wheel that times (forward speed [m/s], angular velocity [rad/s]) are its speed
        over ground along its heading [m/s], for angles of the steering joints [rad], to the left."""
        turned = np.array([*angles, 0.0])[self.steered]
        cosine, sine = np.cos(turned), np.sin(turned)
        return np.column_stack([cosine, sine * (self.x - self.axle) - cosine * self.y])


def geometry_of(client: Any, body: Body, config: BaseConfig) -> BaseGeometry:
    """Return the geometry of a robot as a base. Raises `InputError` if the robot is none that the config describes."""
    if body.frames is None:
        raise InputError("base", f"{body.name!r} is no robot, so that it has nothing to drive")
    frames = body.frames.states(BodyState(), {})
    wheels = [_wheel(client, body, frames, name, config) for name in config.wheels]
    wheels += [_track(client, body, frames, name) for name in config.tracks]
    steering = [_steering(client, body, frames, name) for name in config.steering]
    above = [_steered_by(client, body, wheel.link, config.steering) for wheel in wheels]
    x, y = (np.array([getattr(wheel, axis) for wheel in wheels]) for axis in "xy")
    free = [wheel.x for wheel, joint in zip(wheels, above, strict=True) if joint < 0]
    if config.wheelbase:
        axle = float(np.mean([joint.x for joint in steering])) - config.wheelbase
    else:
        axle = float(np.mean(free or [joint.x for joint in steering]))
    if not steering:
        y = _turning(x, y, config.track, body.name)
    elif any(abs(joint.x - axle) < 1e-3 for joint in steering):
        raise InputError("base", f"steering joints of {body.name!r} are on its axle; name the wheels that no joint "
                         "steers, or give the wheelbase")  # fmt: skip
    return BaseGeometry(
        (*config.wheels, *config.tracks), x, y, np.array([wheel.scale for wheel in wheels]),
        np.array([wheel.limit for wheel in wheels]), np.array(above, np.int64), tuple(steering), axle,
    )  # fmt: skip


def _turning(x: FloatArray, y: FloatArray, track: float, name: str) -> FloatArray:
    """Return the places to the side (n,) [m] by which wheels at ``x``, ``y`` (n,) [m] turn a base without steering.

    Wheels before and behind the middle slip aside in a turn. Coulomb's friction of equal loads is in balance when the
    base turns as if it were wider by the factor 1 + mean(x^2) / mean(y^2), x from the middle of the wheels.
    """
    if not (y.min() < 0.0 < y.max()):
        raise InputError("base", f"wheels or tracks of {name!r} are all on one side of its middle; name those of both")
    if track:
        return np.sign(y) * 0.5 * track
    return y * (1.0 + float(np.var(x) / np.mean(y * y)))


class _Wheel(NamedTuple):
    """A wheel or track: its link in PyBullet, its place [m], and ``scale`` and ``limit`` as of `BaseGeometry`."""

    link: int
    x: float
    y: float
    scale: float
    limit: float


def _wheel(client: Any, body: Body, frames: list[BodyState], name: str, config: BaseConfig) -> _Wheel:
    index, limit = _joint(client, body, name)
    place, along = frames[index + 1].position, _axis(client, body, frames, index)
    _require_along("y", along, f"wheel {name!r} of {body.name!r}")
    radius = config.radius
    if index in body.shapes:
        points = _outermost(client, body, index, frames[index + 1], along)
        radius = radius or float(np.linalg.norm(np.cross(points - place, along), axis=1).max())
        place = _middle(points)
    if not radius:
        raise InputError("base", f"wheel {name!r} of {body.name!r} has no collision shape; give its radius")
    return _Wheel(index, place[0], place[1], math.copysign(1.0, along[1]) / radius, limit)


def _track(client: Any, body: Body, frames: list[BodyState], name: str) -> _Wheel:
    if name not in body.surfaces:
        there = ", ".join(body.surfaces) or "none"
        raise InputError("base", f"{body.name!r} has no track {name!r}; it has {there}")
    drive = body.surfaces[name]
    index = link_index(client, body.uid, drive.link)
    assert index is not None  # as the description was checked
    frame = frames[index + 1]
    along = rotate(frame.orientation, drive.axis)
    _require_along("y", along, f"track {name!r} of {body.name!r}")
    place = _middle(_outermost(client, body, index, frame, along))
    return _Wheel(index, place[0], place[1], math.copysign(1.0, along[1]), drive.limit)


def _steering(client: Any, body: Body, frames: list[BodyState], name: str) -> Steering:
    index, _ = _joint(client, body, name)
    along, (x, y, _) = _axis(client, body, frames, index), frames[index + 1].position
    _require_along("z", along, f"steering joint {name!r} of {body.name!r}")
    low, high = client.getJointInfo(body.uid, index)[8:10]
    right, left = (STEEPEST, STEEPEST) if low >= high else (max(-low, 0.0), max(high, 0.0))  # equal or crossed = none
    if along[2] < 0.0:
        right, left = left, right
    return Steering(name, x, y, math.copysign(1.0, along[2]), min(right, STEEPEST), min(left, STEEPEST))


def _joint(client: Any, body: Body, name: str) -> tuple[int, float]:
    """Return PyBullet's index of a joint and its limit of velocity. Raises `InputError` if there is none."""
    index = body.joint(name)
    return index, client.getJointInfo(body.uid, index)[11] or math.inf


def _axis(client: Any, body: Body, frames: list[BodyState], index: int) -> Vector:
    """Return the axis of a joint in the frame of the root link."""
    inertial = client.getDynamicsInfo(body.uid, index)[4]
    return rotate(product(frames[index + 1].orientation, inertial), client.getJointInfo(body.uid, index)[13])


def _require_along(way: str, axis: Vector, what: str) -> None:
    if not abs(axis["xyz".index(way)]) > STRAIGHT * math.hypot(*axis):  # a fixed joint has none
        raise InputError("base", f"the axis of {what} is not along {way} of the root link")


def _steered_by(client: Any, body: Body, link: int, steering: Sequence[str]) -> int:
    """Return the place in ``steering`` of the joint that turns a link, -1 = none."""
    joints = [body.joints[name] for name in steering]
    while link >= 0 and link not in joints:
        link = client.getJointInfo(body.uid, link)[16]
    return joints.index(link) if link in joints else -1


def _outermost(client: Any, body: Body, index: int, frame: BodyState, axis: Vector) -> FloatArray:
    """Return points (n, 3) [m] of a link's shape in the frame of the root: the outermost along the axes of the root and
    in directions around an ``axis``."""
    angles = np.linspace(0.0, math.tau, AROUND, endpoint=False)
    around = np.column_stack([np.cos(angles), np.sin(angles)]) @ np.linalg.svd([axis])[2][1:]
    surface = Underside([body.shapes[index]], [Transform(*client.getDynamicsInfo(body.uid, index)[3:5])])
    return surface.lowest(frame, np.concatenate([around, np.eye(3), -np.eye(3)]))


def _middle(points: FloatArray) -> Vector:
    """Return the middle of the bounds of points (n, 3) [m]."""
    x, y, z = (0.5 * (points.min(axis=0) + points.max(axis=0))).tolist()
    return x, y, z
