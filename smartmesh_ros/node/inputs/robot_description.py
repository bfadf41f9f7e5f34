"""The robot of the parameter ``robot.description`` or the latched topic ``~/robot_description``."""

from __future__ import annotations

from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from smartmesh_ros.io.urdf import checked_urdf
from smartmesh_ros.node.failures import REFUSED
from smartmesh_ros.node.inputs import bounds
from smartmesh_ros.node.services.initial_bodies import InitialBodies
from smartmesh_ros.node.services.robot_files import robot_name, with_package_paths
from smartmesh_ros.node.services.spawning import Entry
from smartmesh_ros.node.services.turns import Work
from smartmesh_ros.node.session import Session
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class RobotDescription:
    """Keeps one robot, as described last.

    Spawns the robot as soon as the terrain covers its start position. A different description replaces the robot at its
    current pose; a description that does not load changes nothing.
    """

    def __init__(self, session: Session, bodies: InitialBodies) -> None:
        self._session, self._bodies = session, bodies
        self._urdf = ""
        self._received = self._applied = 0  # numbers of descriptions
        if session.settings.robot.description:
            self._take(prepare_robot(with_package_paths(session.settings.robot.description)))
        session.listen(String, "robot_description", self._on_description, LATCHED)

    def _on_description(self, message: Any) -> None:
        robot_name(message.data)  # refuses all but URDF text, such as the path of a file
        self._received += 1
        self._session.turns.add(Work(self._describe(message.data, self._received)), lambda _: None)

    async def _describe(self, text: str, number: int) -> None:
        """Prepare a description and take it, unless a later one was taken meanwhile."""
        session = self._session
        rules = bounds.urdf_rules(session.settings)
        try:
            robot = await session.robots.prepared(lambda: checked_urdf(with_package_paths(text), rules))
            with session.lock:
                if number > self._applied:
                    self._take(robot)
                    self._applied = number
        except REFUSED as error:
            session.refusals.add("robot_description", error)

    def _take(self, robot: PreparedRobot) -> None:
        settings, world = self._session.settings.robot, self._session.world
        if robot.given == self._urdf:
            return
        entry = Entry(
            settings.name, urdf=robot.given, robot=robot, xy=settings.xy, above=settings.above, yaw=settings.yaw
        )
        known = world.bodies.get(settings.name)
        if self._urdf and known is not None and known.is_robot:
            world.replace_robot(settings.name, robot)
            self._bodies.replace(entry)
        else:
            self._bodies.add(entry)
        self._urdf = robot.given
