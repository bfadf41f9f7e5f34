"""Frames of a robot's links, as URDF and ROS define them. PyBullet reports the states of links' centres of mass."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.ground.quaternions import conjugate, product, rotate
from smartmesh_ros.ground.state import BodyState, Quaternion, Vector
from smartmesh_ros.terrain.grid import FloatArray


class InertialFrame(NamedTuple):
    """Pose of a link's centre of mass in the link's frame: position [m] and orientation (x, y, z, w)."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)


def fixed_to(frame: BodyState, place: Vector, turn: Quaternion = (0.0, 0.0, 0.0, 1.0)) -> BodyState:
    """Return the state of what is fixed to a ``frame`` at a ``place`` [m] and turned by ``turn`` in it."""
    arm = rotate(frame.orientation, place)
    (wx, wy, wz), (x, y, z) = frame.angular, arm
    linear = _sum(frame.linear, (wy * z - wz * y, wz * x - wx * z, wx * y - wy * x))
    return BodyState(_sum(frame.position, arm), product(frame.orientation, turn), linear, frame.angular)


def frame_state(centre: BodyState, inertial: InertialFrame) -> BodyState:
    """Return the state of the link's frame, given that of its centre of mass."""
    x, y, z = inertial.position
    orientation = product(centre.orientation, conjugate(inertial.orientation))
    return fixed_to(replace(centre, orientation=orientation), (-x, -y, -z))


def frame_pose(centre: FloatArray, inertial: InertialFrame) -> FloatArray:
    """Return the pose (7,) of the link's frame, position [m] and orientation (x, y, z, w), given that of its centre of
    mass. Other than in a state, its numbers may be not finite."""
    x, y, z, w = centre[3:].tolist()
    orientation = product((x, y, z, w), conjugate(inertial.orientation))
    return np.array([*(centre[:3] - rotate(orientation, inertial.position)), *orientation])


def centre_state(frame: BodyState, inertial: InertialFrame) -> BodyState:
    """Return the state of the centre of mass, given that of the link's frame."""
    return fixed_to(frame, *inertial)


def link_index(client: Any, uid: int, name: str) -> int | None:
    """Return PyBullet's index of a robot's link, -1 = the root; None if there is none of that name."""
    names = [client.getBodyInfo(uid)[0], *(client.getJointInfo(uid, k)[12] for k in range(client.getNumJoints(uid)))]
    return names.index(name.encode()) - 1 if name.encode() in names else None


class LinkFrame(NamedTuple):
    """Pose of a link's frame in that of its ``parent`` (index of the list): translation [m] and rotation (x, y, z, w).
    The root's parent is -1, and its pose that of no motion."""

    name: str
    parent: int
    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)


class LinkFrames:
    """The frames of a PyBullet robot. PyBullet reports the frames of links as they were before the last step; these are
    computed from the joints' current positions. ``rest``: those with all joints at zero; ``axes``: kind of each joint
    in PyBullet, and its axis in the frame of its link."""

    def __init__(self, client: Any, uid: int) -> None:
        self._client, self._uid = client, uid
        joints = [client.getJointInfo(uid, index) for index in range(client.getNumJoints(uid))]
        inertial = [client.getDynamicsInfo(uid, index)[3:5] for index in range(-1, len(joints))]
        self.rest = [LinkFrame(client.getBodyInfo(uid)[0].decode(), -1)]
        self.axes: list[tuple[int, Vector]] = []
        for index, joint in enumerate(joints):
            parent, turn = joint[16] + 1, inertial[index + 1][1]
            (x, y, z), (dx, dy, dz) = inertial[parent][0], rotate(inertial[parent][1], joint[14])
            between = product(inertial[parent][1], product(conjugate(joint[15]), conjugate(turn)))
            self.rest.append(LinkFrame(joint[12].decode(), parent, (x + dx, y + dy, z + dz), between))
            self.axes.append((joint[2], rotate(turn, joint[13])))

    @property
    def root(self) -> str:
        """Name of the root link."""
        return self.rest[0].name

    def read(self) -> list[LinkFrame]:
        """Return the current frames, the root first and parents before their children."""
        positions: Sequence[float] = ()
        if self.axes:
            states = self._client.getJointStates(self._uid, list(range(len(self.axes))))
            positions = [state[0] for state in states]
        return self.at(positions)

    def at(self, positions: Sequence[float]) -> list[LinkFrame]:
        """Return the frames for positions of all joints, in PyBullet's order [rad, m]."""
        moved = [self.rest[0]]
        for frame, (kind, axis), position in zip(self.rest[1:], self.axes, positions, strict=True):
            moved.append(_moved(frame, kind, axis, position))
        return moved

    def states(self, root: BodyState, joints: Mapping[int, tuple[float, float]]) -> list[BodyState]:
        """Return the states of the frames for that of the ``root``, and positions and velocities of ``joints`` by
        PyBullet's index [rad, rad/s or m, m/s]; others are zero."""
        values = [joints.get(index, (0.0, 0.0)) for index in range(len(self.axes))]
        states = [root]
        frames = self.at([position for position, _ in values])
        for frame, (kind, axis), (_, speed) in zip(frames[1:], self.axes, values, strict=True):
            state = fixed_to(states[frame.parent], frame.translation, frame.rotation)
            along = tuple(speed * part for part in rotate(state.orientation, axis))
            if kind == pb.JOINT_REVOLUTE:
                state = replace(state, angular=_sum(state.angular, along))
            elif kind == pb.JOINT_PRISMATIC:
                state = replace(state, linear=_sum(state.linear, along))
            states.append(state)
        return states


def _sum(a: Vector, b: tuple[float, ...]) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _moved(frame: LinkFrame, kind: int, axis: Vector, position: float) -> LinkFrame:
    """Return the frame of a link whose joint is at a ``position`` [rad, m] instead of zero."""
    x, y, z = axis
    if kind == pb.JOINT_REVOLUTE:
        sine = math.sin(0.5 * position)
        turn = (x * sine, y * sine, z * sine, math.cos(0.5 * position))
        return frame._replace(rotation=product(frame.rotation, turn))
    if kind == pb.JOINT_PRISMATIC:
        dx, dy, dz = rotate(frame.rotation, (x * position, y * position, z * position))
        x, y, z = frame.translation
        return frame._replace(translation=(x + dx, y + dy, z + dz))
    return frame
