"""Conversion between the states of a base link's centre of mass, which PyBullet reports, and of its frame, which ROS
uses."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from smartmesh_ros.ground.quaternions import conjugate, product, rotate
from smartmesh_ros.ground.state import BodyState, Quaternion, Vector
from smartmesh_ros.terrain.grid import FloatArray


class InertialFrame(NamedTuple):
    """Pose of a link's centre of mass in the link's frame: position [m] and orientation (x, y, z, w)."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)


def frame_state(centre: BodyState, inertial: InertialFrame) -> BodyState:
    """Return the state of the link's frame, given that of its centre of mass."""
    orientation = product(centre.orientation, conjugate(inertial.orientation))
    return _moved(replace(centre, orientation=orientation), inertial.position, -1.0)


def frame_pose(centre: FloatArray, inertial: InertialFrame) -> FloatArray:
    """Return the pose (7,) of the link's frame, position [m] and orientation (x, y, z, w), given that of its centre of
    mass. Other than in a state, its numbers may be not finite."""
    x, y, z, w = centre[3:].tolist()
    orientation = product((x, y, z, w), conjugate(inertial.orientation))
    return np.array([*(centre[:3] - rotate(orientation, inertial.position)), *orientation])


def centre_state(frame: BodyState, inertial: InertialFrame) -> BodyState:
    """Return the state of the centre of mass, given that of the link's frame."""
    moved = _moved(frame, inertial.position, 1.0)
    return replace(moved, orientation=product(frame.orientation, inertial.orientation))


def _moved(state: BodyState, offset: Vector, sign: float) -> BodyState:
    """State of the point of the same rigid body at ``sign`` x ``offset`` [m], in the link's frame."""
    lever = sign * np.array(rotate(state.orientation, offset))
    position = np.array(state.position) + lever
    linear = np.array(state.linear) + np.cross(state.angular, lever)
    return replace(state, position=tuple(position.tolist()), linear=tuple(linear.tolist()))
