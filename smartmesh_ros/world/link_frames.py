"""Frames of a robot's links relative to each other, as URDF defines them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import pybullet as pb

from smartmesh_ros.ground.quaternions import conjugate, product, rotate
from smartmesh_ros.ground.state import Quaternion, Vector


class LinkFrame(NamedTuple):
    """Pose of a link's frame in that of its ``parent`` (index of the list): translation [m] and rotation (x, y, z, w).
    The root's parent is -1, and its pose that of no motion."""

    name: str
    parent: int
    translation: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)


class LinkFrames:
    """The frames of a PyBullet robot. PyBullet reports the frames of links as they were before the last step; these are
    computed from the joints' current positions."""

    def __init__(self, client: Any, uid: int) -> None:
        self._client, self._uid = client, uid
        joints = [client.getJointInfo(uid, index) for index in range(client.getNumJoints(uid))]
        inertial = [client.getDynamicsInfo(uid, index)[3:5] for index in range(-1, len(joints))]
        self._rest = [LinkFrame(client.getBodyInfo(uid)[0].decode(), -1)]
        self._axes: list[tuple[int, Vector]] = []  # kind of the joint, and its axis in the frame of the link
        for index, joint in enumerate(joints):
            parent, turn = joint[16] + 1, inertial[index + 1][1]
            (x, y, z), (dx, dy, dz) = inertial[parent][0], rotate(inertial[parent][1], joint[14])
            between = product(inertial[parent][1], product(conjugate(joint[15]), conjugate(turn)))
            self._rest.append(LinkFrame(joint[12].decode(), parent, (x + dx, y + dy, z + dz), between))
            self._axes.append((joint[2], rotate(turn, joint[13])))

    @property
    def root(self) -> str:
        """Name of the root link."""
        return self._rest[0].name

    def read(self) -> list[LinkFrame]:
        """Return the current frames, the root first and parents before their children."""
        positions: Sequence[float] = ()
        if self._axes:
            states = self._client.getJointStates(self._uid, list(range(len(self._axes))))
            positions = [state[0] for state in states]
        moved = [self._rest[0]]
        for frame, (kind, axis), position in zip(self._rest[1:], self._axes, positions, strict=True):
            moved.append(_moved(frame, kind, axis, position))
        return moved


def _moved(frame: LinkFrame, kind: int, axis: Vector, position: float) -> LinkFrame:
    """Return the frame of a link whose joint is at a ``position`` [rad, m] instead of zero."""
    x, y, z = axis
    if kind == pb.JOINT_REVOLUTE:
        sine = math.sin(0.5 * position) / (math.hypot(x, y, z) or 1.0)  # PyBullet keeps an axis as the URDF gives it
        turn = (x * sine, y * sine, z * sine, math.cos(0.5 * position))
        return frame._replace(rotation=product(frame.rotation, turn))
    if kind == pb.JOINT_PRISMATIC:
        dx, dy, dz = rotate(frame.rotation, (x * position, y * position, z * position))
        x, y, z = frame.translation
        return frame._replace(translation=(x + dx, y + dy, z + dz))
    return frame
