"""The frame and the instant of a question about the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.inputs.frames import IDENTITY, Transform
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.session import Session
from smartmesh_ros.node.timing.clock import stamp_of
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.standing import NO_TERRAIN

# Largest difference between the instant of a question and now [s].
FARTHEST = 1.0
# Most bodies that a refusal names.
MOST_NAMED = 10
# Tilt of a frame's z axis that counts as rounding [-].
LEVEL = 1e-6


@dataclass(frozen=True)
class AskedFrame:
    """The frame and the instant of a question.

    ``transform``: pose of the frame in the terrain's frame. ``time`` [s]: the instant in simulated time. ``header``:
    frame and stamp that the answer carries.
    """

    transform: Transform
    time: float
    header: Header

    @property
    def rotation(self) -> FloatArray:
        """From the frame to the terrain's frame (3, 3)."""
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        return np.array([rotate(self.transform.rotation, axis) for axis in axes]).T

    def points_w(self, points: FloatArray) -> FloatArray:
        """Return points (N, 3) [m] in the terrain's frame; z may be infinite if the frame is level."""
        if self.transform is IDENTITY:
            return points
        rotation, translation = self.rotation, np.array(self.transform.translation)
        with np.errstate(all="ignore"):  # numbers that are too large are refused afterwards
            if np.isinf(points[:, 2]).any():
                flat = points[:, :2] @ rotation[:2, :2].T
                return np.asarray(np.column_stack([flat, points[:, 2]]) + translation)
            return np.asarray(points @ rotation.T + translation)

    def vectors_w(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (N, 3) in the terrain's frame."""
        return vectors if self.transform is IDENTITY else np.asarray(vectors @ self.rotation.T)

    def vectors(self, vectors_w: FloatArray) -> FloatArray:
        """Return vectors (N, 3) of the terrain's frame in this frame."""
        return vectors_w if self.transform is IDENTITY else np.asarray(vectors_w @ self.rotation)

    def require_level(self, frame_id: str) -> None:
        """Raise `InputError` if the frame's z axis is not vertical."""
        x, y, z = rotate(self.transform.rotation, (0.0, 0.0, 1.0))
        tilt = math.hypot(x, y)
        if tilt > LEVEL or z < 0.0:
            degrees = math.degrees(math.atan2(tilt, z))
            raise InputError(
                "frame",
                f"frame {frame_id!r} is tilted by {degrees:.3g} degrees, and heights need a level one; ask in another "
                "frame, or cast rays with ~/cast_rays",
            )


def asked_frame(session: Session, transforms: TransformInput, header: Any) -> AskedFrame:
    """Return the frame and the instant that a request's header asks for. Raises `InputError`: while the physics is
    paused, before the first map, for an unknown frame, and for a stamp far from now."""
    if session.paused:
        raise InputError("paused", "the physics is paused, and its time with it; call ~/pause with data: false first")
    if not session.world.terrain.tiles:
        raise InputError("no_map", NO_TERRAIN)
    stamp = conversions.stamp_seconds(header.stamp)
    if stamp is None:
        time, instant = session.world.time, stamp_of(_stamp_of_world(session))
    else:
        instant, age = header.stamp, session.clock_now() - stamp
        if abs(age) > FARTHEST:
            raise InputError(
                "stamp",
                f"stamp {stamp:.3f} s is {age:.3f} s before this node's time; ask for an instant within {FARTHEST:g} s "
                "of now, or with stamp zero for now",
            )
        time = session.time_at(age)
    answer = Header(stamp=instant, frame_id=header.frame_id or session.frame_id)
    return AskedFrame(_transform(session, transforms, header.frame_id, stamp), time, answer)


def _transform(session: Session, transforms: TransformInput, frame_id: str, stamp: float | None) -> Transform:
    """Return the pose of a frame in the terrain's frame: of a body of that name, or else of a frame of TF."""
    if frame_id in session.world.bodies and frame_id != session.frame_id:
        state = session.world.base_state(frame_id)
        return Transform(state.position, state.orientation)
    listening = transforms.listening
    try:
        return transforms.to_terrain(frame_id, stamp) or IDENTITY
    except InputError as error:
        names = [name for name in session.world.bodies if name]
        there = f"the bodies are {', '.join(names[:MOST_NAMED])}" if names else "there are no bodies"
        again = "" if listening or not transforms.listening else "; the node has just subscribed to /tf, so ask again"
        raise InputError("frame", f"no body is called {frame_id!r} ({there}), and as a frame: {error}{again}") from None


def _stamp_of_world(session: Session) -> float:
    """Return the stamp of the world's time [s], at which the bodies are."""
    if session.settings.publish.clock:
        return session.world.time
    return session.clock.stamp_now() + session.ahead_of_stamps()
