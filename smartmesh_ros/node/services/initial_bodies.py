"""Bodies named by parameters, and the robot of ``robot.description`` or the latched topic ``~/robot_description``.

They are spawned at the start or once the terrain covers their place, and again after a full reset. The parameter
``bodies.spawn`` has one YAML mapping for each body:
``{id: ball, shape: sphere, size: [0.2], mass: 1.0, xy: [0, 0], above: 0.5}``, with ``shape`` sphere [radius],
box [x, y, z], cylinder [height, radius] or capsule [height, radius] in metres; or ``urdf`` with a file. ``xyz`` is the
position in the terrain's frame. With ``xy`` the body waits for the ground: with ``clearance`` its lowest point starts
that far above the ground, 0 by default, and with ``align: true`` it is tilted with the ground; with ``above`` instead
its centre starts that far above the ground. ``yaw`` [rad] is the turn about z.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import yaml
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from smartmesh_ros.errors import InputError, suggestion
from smartmesh_ros.ground.shapes import SHAPES_BY_NAME, Shape, shape_from
from smartmesh_ros.ground.state import BodyState, Vector
from smartmesh_ros.node.services.robot_files import robot_name, with_package_paths
from smartmesh_ros.node.services.turns import Work, in_turns
from smartmesh_ros.node.session import REFUSED, Session
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.world import World

# The C parser takes a tenth of the time, which matters for a thousand bodies.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_BODY = {"shape", "size", "mass", "urdf"}
_KEYS = {"id", "xyz", "xy", "above", "clearance", "align", "yaw"} | _BODY


@dataclass(frozen=True)
class Entry:
    """A body to spawn: a shape of ``mass`` [kg] or a URDF, with ``yaw`` [rad] about z.

    It starts at ``xyz`` [m], or at ``xy`` [m]: its centre ``above`` [m] the ground, or its lowest point ``clearance``
    [m] above the ground and, with ``align``, tilted with it.
    """

    name: str
    shape: Shape | None = None
    mass: float = 1.0
    urdf: str = ""
    robot: PreparedRobot | None = None  # of ``urdf``
    xyz: Vector | None = None
    xy: tuple[float, float] = (0.0, 0.0)
    above: float | None = None
    clearance: float = 0.0
    align: bool = False
    yaw: float = 0.0

    @property
    def on_ground(self) -> bool:
        """True if the ground determines the height of the lowest point."""
        return self.xyz is None and self.above is None


def entry_from_text(text: str, urdf: str = "") -> Entry:
    """Return the entry of a YAML mapping, of a robot if its ``urdf`` is given. Raises `InputError` if the text is no
    valid entry."""
    what, keys = ("robot.start", _KEYS - _BODY) if urdf else ("bodies.spawn entry", _KEYS)
    try:
        entry = yaml.load(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise InputError("spawn", f"{what} {text!r} is not YAML: {error}") from None
    if not isinstance(entry, dict) or "id" not in entry:
        raise InputError("spawn", f"{what} {text!r} must be a mapping with id and any of {sorted(keys)}")
    for key in entry.keys() - keys:
        words = f"{key!r} is unknown{suggestion(str(key), keys)}; the keys are {', '.join(sorted(keys))}"
        raise InputError("spawn", f"{what} {text!r}: {words}")
    urdf = urdf or str(entry.get("urdf", ""))
    shape = None if urdf else _shape_of(entry, text)
    with _refused(text, ": mass and yaw must be numbers"):
        mass, yaw = float(entry.get("mass", 1.0)), float(entry.get("yaw", 0.0))
    with _refused(text, " needs xyz: [x, y, z], or xy: [x, y] with clearance or above"):
        place = _place(entry)
    if {"clearance", "align"} & entry.keys() and {"xyz", "above"} & entry.keys():
        raise InputError(
            "spawn", f"bodies.spawn entry {text!r}: clearance and align go with xy alone, not with xyz or above"
        )
    return Entry(str(entry["id"]), shape=shape, mass=mass, urdf=urdf, yaw=yaw, **place)


def _shape_of(entry: dict[str, Any], text: str) -> Shape:
    """Return the shape of an entry. Raises `InputError`."""
    known, name = ", ".join(SHAPES_BY_NAME), entry.get("shape")
    if name is None:
        raise InputError("spawn", f"bodies.spawn entry {text!r} needs a shape ({known}) and its size, or a urdf")
    if name not in [*SHAPES_BY_NAME]:
        words = f"there is no shape {name!r}{suggestion(str(name), SHAPES_BY_NAME)}; choose {known}"
        raise InputError("spawn", f"bodies.spawn entry {text!r}: {words}")
    with _refused(text, " needs the size of its shape in metres, such as size: [0.2]"):
        try:
            return shape_from(SHAPES_BY_NAME[name], entry["size"])
        except InputError as error:
            raise InputError("spawn", f"bodies.spawn entry {text!r}: {error}") from None


@contextmanager
def _refused(text: str, words: str) -> Iterator[None]:
    """Raise `InputError` with ``words`` about an entry's text if the block cannot convert it."""
    try:
        yield
    except InputError:
        raise
    except (KeyError, TypeError, ValueError):
        raise InputError("spawn", f"bodies.spawn entry {text!r}{words}") from None


def _place(entry: dict[str, Any]) -> dict[str, Any]:
    if "xyz" in entry:
        x, y, z = (float(value) for value in entry["xyz"])
        return {"xyz": (x, y, z)}
    x, y = (float(value) for value in entry["xy"])
    if "above" in entry:
        return {"xy": (x, y), "above": float(entry["above"])}
    clearance = float(entry.get("clearance", 0.0))
    return {"xy": (x, y), "clearance": clearance, "align": bool(entry.get("align", False))}


def state_of(world: World, entry: Entry) -> BodyState | None:
    """Return the state of an entry, which the ground may lift; None if the terrain does not cover its place yet."""
    position = entry.xyz
    if position is None:
        x, y = entry.xy
        height = float(world.terrain.at([[x, y]], world.time).heights[0])
        if math.isnan(height):
            return None
        position = (x, y, height + (entry.above or 0.0))
    return BodyState(position, (0.0, 0.0, math.sin(0.5 * entry.yaw), math.cos(0.5 * entry.yaw)))


def spawn(world: World, entry: Entry) -> bool:
    """Spawn the body of an entry. Return False if the terrain does not cover its place yet. Raises `InputError` if the
    world refuses the body."""
    state = state_of(world, entry)
    if state is None:
        return False
    standing: dict[str, Any] = {"on_ground": entry.on_ground, "clearance": entry.clearance, "align": entry.align}
    if entry.shape is None:
        world.spawn_robot(entry.name, entry.robot or entry.urdf, state, **standing)
    else:
        world.spawn(entry.name, entry.shape, entry.mass, state, **standing)
    return True


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
        if not waiting and entry.xyz is not None and not self._session.world.terrain.empty:
            self._session.start_of(entry.name, BodyState(entry.xyz))
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

    def has(self, name: str) -> bool:
        """Return True if a body is there, or will be."""
        return any(name in known for known in (self._session.world.bodies, self._waiting, self._standing))

    def restore(self, names: Collection[str] | None = None) -> None:
        """Spawn again the initial bodies that were removed, None = all, or those of some ``names``."""
        chosen = [name for name in self._entries if names is None or name in names]
        self._waiting += [name for name in chosen if not self.has(name)]
        self.on_terrain()


LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class RobotDescription:
    """Keeps one robot, as described last.

    Spawns the robot as soon as the terrain covers its start position, and again if the same description comes after it
    was removed. A different description replaces the robot at its current pose; a description that does not load
    changes nothing.
    """

    def __init__(self, session: Session, bodies: InitialBodies) -> None:
        self._session, self._bodies = session, bodies
        self._urdf = ""
        self._received = self._applied = 0  # numbers of descriptions
        self._entry = entry_from_text(session.settings.robot.start, "of the description")
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
        world = self._session.world
        if robot.given == self._urdf and self._bodies.has(self._entry.name):
            return
        entry = replace(self._entry, urdf=robot.given, robot=robot)
        known = world.bodies.get(entry.name)
        if self._urdf and known is not None and known.is_robot:
            world.replace_robot(entry.name, robot)
            self._bodies.replace(entry)
        else:
            self._bodies.add(entry)
        self._urdf = robot.given
