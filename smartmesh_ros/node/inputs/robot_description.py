"""The robot of the parameter ``robot.description`` or the latched topic ``~/robot_description``."""

from __future__ import annotations

from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from smartmesh_ros.io.urdf import checked_urdf
from smartmesh_ros.node.inputs import bounds
from smartmesh_ros.node.services.initial_bodies import InitialBodies
from smartmesh_ros.node.services.robot_files import robot_name, with_package_paths
from smartmesh_ros.node.services.spawning import Entry
from smartmesh_ros.node.session import Session

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class RobotDescription:
    """Keeps one robot, as described last.

    Spawns the robot as soon as the terrain covers its start position. A different description replaces the robot at its
    current pose; a description that does not load changes nothing.
    """

    def __init__(self, session: Session, bodies: InitialBodies) -> None:
        self._session, self._bodies = session, bodies
        self._urdf = ""
        if session.settings.robot.description:
            self._take(session.settings.robot.description)
        session.listen(String, "robot_description", self._on_description, LATCHED)

    def _on_description(self, message: Any) -> None:
        robot_name(message.data)  # refuses all but URDF text, such as the path of a file
        urdf = with_package_paths(message.data)
        self._take(checked_urdf(urdf, bounds.urdf_rules(self._session.settings)))

    def _take(self, text: str) -> None:
        settings, world = self._session.settings.robot, self._session.world
        urdf = with_package_paths(text)
        if urdf == self._urdf:
            return
        entry = Entry(settings.name, urdf=urdf, xy=settings.xy, above=settings.above, yaw=settings.yaw)
        if self._urdf and settings.name in world.bodies:
            world.replace_robot(settings.name, urdf)
            self._bodies.replace(entry)
        else:
            self._bodies.add(entry)
        self._urdf = urdf
