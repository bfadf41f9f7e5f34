"""Frames that this node sends on ``/tf``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import TransformStamped
from std_msgs.msg import Header

from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs.optional_messages import require_message
from smartmesh_ros.node.inputs.transform_input import TransformInput
from smartmesh_ros.node.outputs.cdr import ArrayMessage, fields_of, stamp_fields
from smartmesh_ros.node.session import Session

TOPIC = "/tf"
_FIELDS = (*fields_of("transform.translation"), *fields_of("transform.rotation", "xyzw"))


class OwnFrame(NamedTuple):
    """A frame and its pose in the frame ``parent``."""

    parent: str
    child: str
    pose: Transform


class Broadcast:
    """Publishes frames, and notes that they are this node's own. Raises `InputError` if the package of TFMessage is not
    installed, which ``what`` needs."""

    def __init__(self, session: Session, transforms: TransformInput, what: str) -> None:
        self._session, self._transforms = session, transforms
        self._kind = require_message("tf2_msgs", "TFMessage", what)
        self._publisher = session.node.create_publisher(self._kind, TOPIC, 100)
        self._message = ArrayMessage()
        self._stamp = (0, 0)

    def close(self) -> None:
        """Remove the publisher."""
        self._session.node.destroy_publisher(self._publisher)

    def is_next(self, header: Header) -> bool:
        """Return True if a header has another stamp than that of the last call: listeners warn of a frame that comes
        twice at one time."""
        before, self._stamp = self._stamp, (header.stamp.sec, header.stamp.nanosec)
        return self._stamp != before

    def send(self, header: Header, frames: list[OwnFrame]) -> None:
        """Publish frames with the stamp of a header."""
        message = self._message
        message.start("frames", self._kind)
        numbers = np.array([(*frame.pose.translation, *frame.pose.rotation) for frame in frames])
        message.add_named(
            lambda parent, child: TransformStamped(header=Header(frame_id=parent), child_frame_id=child),
            {
                "header.frame_id": [frame.parent for frame in frames],
                "child_frame_id": [frame.child for frame in frames],
            },
            dict(zip(_FIELDS, numbers.T, strict=True)) | stamp_fields(header),
        )
        data = message.finish()
        self._transforms.note_own(data)
        self._publisher.publish(data)
