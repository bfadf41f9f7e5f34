"""Bodies named by parameters, and the robot of ``robot.description`` or the latched topic ``~/robot_description``.

They are spawned at the start or once the terrain covers their place, and again after a full reset.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.services.robot_files import robot_name, with_package_paths
from smartmesh_ros.node.services.spawning import Entry, entry_from_text, spawn, state_of
from smartmesh_ros.node.services.turns import Work, in_turns
from smartmesh_ros.node.session import REFUSED, Session
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot


class InitialBodies:
    """Entries of ``bodies.spawn``, and entries added later. ``names``: of all entries, in the world or waiting."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._entries: dict[str, Entry] = {}
        self._waiting: list[str] = []
        self._standing: set[str] = set()  # robots that are being put onto the ground
        for text in session.settings.spawn:
            entry = entry_from_text(text)
            if entry.name in self._entries:
                raise InputError("spawn", f"bodies.spawn names {entry.name!r} twice; names must be distinct")
            self.add(entry)

    @property
    def names(self) -> set[str]:
        """Names of the initial bodies."""
        return set(self._entries)

    def add(self, entry: Entry) -> None:
        """Add an entry, or replace the entry of the same name, and spawn its body unless it must wait for terrain.
        Raises `InputError`, and changes nothing, if the body is refused."""
        if entry.urdf and entry.robot is None:
            entry = replace(entry, robot=prepare_robot(with_package_paths(entry.urdf)))
        waiting = not spawn(self._session.world, entry)
        self._entries[entry.name] = entry
        self._waiting = [name for name in self._waiting if name != entry.name]
        if waiting:
            self._waiting.append(entry.name)

    def replace(self, entry: Entry) -> None:
        """Replace the entry of the same name without spawning: its body is in the world already, or waits."""
        self._entries[entry.name] = entry

    def on_terrain(self) -> None:
        """Spawn the bodies that waited for terrain."""
        waiting, self._waiting = self._waiting, []
        for name in waiting:
            entry = self._entries[name]
            if entry.robot is not None and entry.on_ground and state_of(self._session.world, entry) is not None:
                self._standing.add(name)
                self._session.turns.add(Work(self._stand(entry, entry.robot)), lambda _: None)
                continue
            try:
                if not spawn(self._session.world, entry):
                    self._waiting.append(name)
            except REFUSED as error:
                self._note(name, error)

    async def _stand(self, entry: Entry, robot: PreparedRobot) -> None:
        """Spawn a robot on the ground, in turns."""
        session = self._session
        world = session.world
        try:
            state = state_of(world, entry)
            if state is None:
                self._waiting.append(entry.name)
                return
            stance = await in_turns(world.stance_of_robot(entry.name, robot, state, align=entry.align), session.lock)
            with session.lock:
                world.spawn_robot(entry.name, robot, stance.on(world.ground_at, entry.clearance))
        except REFUSED as error:
            self._note(entry.name, error)
        finally:
            self._standing.discard(entry.name)

    def _note(self, name: str, error: Exception) -> None:
        """Count and log a refusal. What PyBullet failed at is tried again with the next map."""
        self._session.refusals.add("bodies.spawn", error)
        if not isinstance(error, InputError):
            self._waiting.append(name)

    def restore(self) -> None:
        """Spawn again the initial bodies that were removed."""
        for name in self._entries:
            if not any(name in known for known in (self._session.world.bodies, self._waiting, self._standing)):
                self._waiting.append(name)
        self.on_terrain()


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
        try:
            robot = await session.robots.prepared(text, session.settings)
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
