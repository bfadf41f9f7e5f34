"""Frames of a robot's links, as URDF and ROS define them. PyBullet reports the states of links' centres of mass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.ground.body_shapes import link_names
from smartmesh_ros.ground.quaternions import about, conjugate, product, rotate
from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.ground.transform import IDENTITY, Transform, added, fixed_to
from smartmesh_ros.terrain.grid import FloatArray


def frame_state(centre: BodyState, inertial: Transform) -> BodyState:
    """Return the state of a link's frame, given that of its centre of mass and the latter's pose in the frame."""
    return fixed_to(centre, inertial.inverse())


def frame_pose(centre: FloatArray, inertial: Transform) -> FloatArray:
    """Return the pose (7,) of a link's frame as `frame_state` does, given that of its centre of mass; its numbers may
    be not finite."""
    x, y, z, qx, qy, qz, qw = centre.tolist()
    pose = Transform((x, y, z), (qx, qy, qz, qw)).then(inertial.inverse())
    return np.array([*pose.translation, *pose.rotation])


def link_index(client: Any, uid: int, name: str) -> int | None:
    """Return PyBullet's index of a robot's link, -1 = the root; None if there is none of that name."""
    names = link_names(client, uid)
    return names.index(name) - 1 if name in names else None


class LinkFrame(NamedTuple):
    """A link's frame and its ``pose`` in that of its ``parent`` (index of the list). The root's parent is -1, and its
    pose that of no motion."""

    name: str
    parent: int
    pose: Transform = IDENTITY


class LinkFrames:
    """The frames of a PyBullet robot. PyBullet reports the frames of links as they were before the last step; these are
    computed from the joints' current positions. ``rest``: those with all joints at zero; ``axes``: kind of each joint
    in PyBullet, and its axis in the frame of its link."""

    def __init__(self, client: Any, uid: int) -> None:
        self._client, self._uid = client, uid
        joints = [client.getJointInfo(uid, index) for index in range(client.getNumJoints(uid))]
        inertial = [Transform(*client.getDynamicsInfo(uid, index)[3:5]) for index in range(-1, len(joints))]
        names = link_names(client, uid)
        self.rest = [LinkFrame(names[0], -1)]
        self.axes: list[tuple[int, Vector]] = []
        for index, joint in enumerate(joints):
            parent, turn = joint[16] + 1, inertial[index + 1].rotation
            between = Transform(joint[14], product(conjugate(joint[15]), conjugate(turn)))
            self.rest.append(LinkFrame(names[index + 1], parent, inertial[parent].then(between)))
            self.axes.append((joint[2], rotate(turn, joint[13])))

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
            state = fixed_to(states[frame.parent], frame.pose)
            x, y, z = rotate(state.orientation, axis)
            along = speed * x, speed * y, speed * z
            if kind == pb.JOINT_REVOLUTE:
                state = replace(state, angular=added(state.angular, along))
            elif kind == pb.JOINT_PRISMATIC:
                state = replace(state, linear=added(state.linear, along))
            states.append(state)
        return states


def _moved(frame: LinkFrame, kind: int, axis: Vector, position: float) -> LinkFrame:
    """Return the frame of a link whose joint is at a ``position`` [rad, m] instead of zero."""
    if kind == pb.JOINT_REVOLUTE:
        motion = Transform(rotation=about(axis, position))
    elif kind == pb.JOINT_PRISMATIC:
        x, y, z = axis
        motion = Transform((x * position, y * position, z * position))
    else:
        return frame
    return frame._replace(pose=frame.pose.then(motion))
