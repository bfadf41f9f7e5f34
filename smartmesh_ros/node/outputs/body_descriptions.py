"""``~/body_descriptions``: the shape of every body, for viewers."""

from __future__ import annotations

import array
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.node.services.robot_files import urdf_text
from smartmesh_ros.node.session import Session
from smartmesh_ros.world.bodies import Body

# Period of the check for added and removed bodies [s].
PERIOD = 0.1
# Late subscribers receive the last message.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class BodyDescriptions:
    """Publishes all descriptions when a body is added or removed, while the topic has subscribers."""

    def __init__(self, session: Session) -> None:
        self._session = session
        session.topics.publish("~/body_descriptions")
        self.publisher = session.node.create_publisher(BodyDescriptionArray, "~/body_descriptions", LATCHED)
        self._described: list[Body] | None = None  # in the last message; None = no subscribers
        self._due = 0.0

    def publish(self) -> None:
        """Publishes the descriptions if they are due and have changed."""
        now = monotonic()
        if now < self._due:
            return
        self._due = now + PERIOD
        if not self.publisher.get_subscription_count():
            self._described = None
            return
        bodies = [body for body in self._session.world.bodies.values() if not body.owner]
        if bodies != self._described:
            header = Header(stamp=self._session.stamp_now(), frame_id=self._session.frame_id)
            self.publisher.publish(BodyDescriptionArray(header=header, bodies=[description(body) for body in bodies]))
            self._described = bodies


def description(body: Body) -> BodyDescription:
    """Return the description of a body."""
    made = BodyDescription(id=body.name, tracked=body.tracked)
    if body.urdf is not None:
        made.shape = BodyDescription.ROBOT
        with suppress(InputError):  # the file may have been deleted since the robot was loaded
            made.urdf = urdf_text(body.urdf)
        if body.urdf != made.urdf:
            made.urdf_file = str(Path(body.urdf).absolute())
        return made
    shape: Any = body.shape or Sphere(body.radius)
    made.shape = getattr(BodyDescription, type(shape).__name__.upper())
    made.dimensions = array.array("d", list(shape.dimensions.values()))
    return made
