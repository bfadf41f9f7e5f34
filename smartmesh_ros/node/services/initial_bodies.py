"""Bodies named by parameters, and the robot of ``robot.description`` or the latched topic ``~/robot_description``.

They are spawned at the start or once the terrain covers their place, and again after a full reset.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from std_msgs.msg import String

from smartmesh_ros.errors import InputError, naming
from smartmesh_ros.ground.quaternions import Z, about
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.services.body_entries import Entry, entries_from, start_from
from smartmesh_ros.node.services.files import robot_name
from smartmesh_ros.node.services.turns import next_turn
from smartmesh_ros.node.session import REFUSED, Session
from smartmesh_ros.node.transport import LATCHED
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.world import World


def add_to(world: World, name: str, what: Shape | PreparedRobot, state: BodyState, given: Any) -> None:
    """Add a body, or a robot, that stands as its entry or specification ``given`` says. Raises `InputError` if the
    world refuses it."""
    standing = {"on_ground": given.on_ground, "clearance": given.clearance, "align": given.align}
    if isinstance(what, PreparedRobot):
        world.spawn_robot(name, what, state, **standing)
    else:
        world.spawn(name, what, given.mass, state, **standing)


class InitialBodies:
    """Entries of ``bodies.spawn``, and entries added later. ``names``: bodies with which the scene begins, in the world
    or not; those of a restored state may have no entry here. ``refused``: why a body could not be spawned, by name.
    ``waiting``: names of the bodies that wait for terrain, and whether they are being put onto it."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.entries: dict[str, Entry] = {}
        self.names: set[str] = set()
        self.refused: dict[str, str] = {}
        self.waiting: dict[str, bool] = {}
        for entry in entries_from(session.settings.spawn).values():
            with naming("bodies.spawn"):
                self.add(entry)

    def add(self, entry: Entry) -> None:
        """Add an entry, or replace the entry of the same name, and spawn its body unless it must wait for terrain.
        Raises `InputError`, and changes nothing, if the body is refused."""
        if entry.urdf and entry.robot is None:
            entry = replace(entry, robot=prepare_robot(entry.urdf))
        spawned = self._spawn(entry)
        if spawned and entry.xyz is not None and not self._session.world.terrain.empty:
            self._session.start_of(entry.name, BodyState(entry.xyz))
        self.replace(entry)
        self.waiting.pop(entry.name, None)
        if not spawned:
            self.waiting[entry.name] = False

    def start_over(self, entries: Mapping[str, Entry]) -> None:
        """Have other entries, none of whose bodies is in the world; they are spawned by `on_terrain`."""
        self.entries, self.names, self.waiting = dict(entries), {*entries}, dict.fromkeys(entries, False)
        self.refused.clear()

    def take_restored(self, waiting: Collection[str], names: Collection[str] | None) -> None:
        """Go on after the world was replaced by one for which some bodies were ``waiting``, and which began with bodies
        of these ``names``, None = not known. Others that are not in it were removed there."""
        if names is not None:
            self.names = {*names}
        self.entries = {name: replace(entry) for name, entry in self.entries.items()}  # `_stand` gives up the others
        there = self._session.world.bodies
        self.waiting = {name: False for name in self.entries if name in waiting and name not in there}
        self.on_terrain()

    def _spawn(self, entry: Entry) -> bool:
        """Spawn the body of an entry, which the ground may lift. Return False if the terrain does not cover its place
        yet."""
        world, what, position = self._session.world, entry.shape or entry.robot, entry.xyz
        if position is None:
            height = float(world.terrain.at([entry.xy], world.time).heights[0])
            position = (*entry.xy, height + (entry.above or 0.0))
        if what is None or math.isnan(position[2]):
            return False
        add_to(world, entry.name, what, BodyState(position, about(Z, entry.yaw)), entry)
        return True

    def replace(self, entry: Entry) -> None:
        """Replace the entry of the same name without spawning: its body is in the world already, or waits."""
        self.entries[entry.name] = entry
        self.names.add(entry.name)

    def on_terrain(self) -> None:
        """Spawn the bodies that waited for terrain."""
        for name in [name for name, begun in self.waiting.items() if not begun]:
            self.waiting[name] = True
            self._session.turns.begin(self._stand(self.entries[name]))

    async def _stand(self, entry: Entry) -> None:
        """Spawn the body of an entry; one on the ground, which takes longer, in the next turn, unless there is another
        scene by then. What PyBullet failed at, or is partly over no ground, is tried again with the next map."""
        if entry.on_ground:
            await next_turn()
        with self._session.lock:
            if self.entries.get(entry.name) is not entry:
                return
            try:
                again = not self._spawn(entry)
            except REFUSED as error:
                self._session.refusals.add(f"start of {entry.name!r}", error)
                self.refused[entry.name] = str(error)
                again = not isinstance(error, InputError) or error.reason == "no_ground"
            del self.waiting[entry.name]
            if again:
                self.waiting[entry.name] = False

    def has(self, name: str) -> bool:
        """Return True if a body is there, or will be."""
        return name in self._session.world.bodies or name in self.waiting

    def restore(self, names: Collection[str] | None = None) -> None:
        """Spawn again the initial bodies that were removed, None = all, or those of some ``names``."""
        scene = [name for name in self.entries if name in self.names]
        chosen = [name for name in scene if names is None or name in names]
        self.waiting |= {name: False for name in chosen if not self.has(name)}
        self.on_terrain()


class RobotDescription:
    """Keeps one robot, as described last.

    Spawns the robot as soon as the terrain covers its start position, and again if the same description comes after it
    was removed. A different description replaces the robot at its current pose; a description that does not load
    changes nothing. ``urdf``: the one that was taken, empty = none.
    """

    def __init__(self, session: Session, bodies: InitialBodies) -> None:
        self._session, self._bodies = session, bodies
        self.urdf = ""
        self._received = self._applied = 0  # numbers of descriptions
        self._entry = start_from(session.settings.robot_start)
        if given := session.settings.robot_description:
            with naming("robot.description"):
                self._take(prepare_robot(given))
        session.listen(String, "robot_description", self._on_description, LATCHED)

    def take_restored(self, *, described: bool) -> None:
        """Go on after the world was replaced: its robot is that of a description if one was ``described`` there."""
        known = self._session.world.bodies.get(self._entry.name)
        self.urdf = known.urdf or "" if described and known is not None else ""

    def _on_description(self, message: Any) -> None:
        robot_name(message.data)  # refuses all but URDF text, such as the path of a file
        self._received += 1
        self._session.turns.begin(self._describe(message.data, self._received))

    async def _describe(self, text: str, number: int) -> None:
        """Prepare a description and take it, unless a later one was taken meanwhile."""
        session = self._session
        try:
            robot = await session.files.prepared(text, session.settings)
            with session.lock:
                if number > self._applied:
                    self._take(robot)
                    self._applied = number
        except REFUSED as error:
            session.refusals.add("robot_description", error)

    def _take(self, robot: PreparedRobot) -> None:
        world = self._session.world
        entry = replace(self._entry, urdf=robot.given, robot=robot)
        if robot.given == self.urdf and self._bodies.has(entry.name):
            if entry.name not in self._bodies.entries:  # the robot of a restored state
                self._bodies.replace(entry)
            return
        known = world.bodies.get(entry.name)
        if self.urdf and known is not None and known.is_robot:
            world.replace_robot(entry.name, robot)
            self._bodies.replace(entry)
        else:
            self._bodies.add(entry)
        self.urdf = robot.given
