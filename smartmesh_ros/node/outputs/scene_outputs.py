"""``~/scene``: the ground and the bodies on it, for RViz; ``~/robot_model``: the first robot, for its RobotModel."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.ground.shapes import ShapeKind
from smartmesh_ros.node.inputs.conversions import RobotNames
from smartmesh_ros.node.outputs.cdr import ArrayMessage, fields_of, stamp_fields
from smartmesh_ros.node.outputs.ground_view import ground_points, window_around
from smartmesh_ros.node.outputs.patch_outputs import deletion
from smartmesh_ros.node.outputs.rates import Rhythm
from smartmesh_ros.node.session import Session
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.robots.description import is_text, named_file, urdf_text
from smartmesh_ros.world.states import SimulatedStates, body_table
from smartmesh_ros.world.world import World

BALL, BOX, CYLINDER, CAPSULE = ShapeKind.BALL, ShapeKind.BOX, ShapeKind.CYLINDER, ShapeKind.CAPSULE
TYPES = {BALL: Marker.SPHERE, BOX: Marker.CUBE, CYLINDER: Marker.CYLINDER}
Colour = tuple[float, float, float, float]
# Colours of bodies by their kinds, of tracked bodies, and of the ground (r, g, b, a).
COLOURS: dict[ShapeKind, Colour] = {
    BALL: (0.2, 0.36, 0.66, 1.0), BOX: (0.55, 0.23, 0.47, 1.0), CYLINDER: (0.12, 0.45, 0.38, 1.0),
    CAPSULE: (0.47, 0.37, 0.16, 1.0),
}  # fmt: skip
TRACKED, GROUND = (0.6, 0.6, 0.6, 0.5), (0.45, 0.5, 0.42, 1.0)
# Highest rate at which ground that changes is drawn [Hz].
GROUND_RATE = 10.0
# Markers of a body: a capsule is a cylinder and two balls.
PER_BODY = 3
_FIELDS = (*fields_of("pose.position"), *fields_of("pose.orientation", "xyzw"), *fields_of("scale"))


class Drawn(NamedTuple):
    """Markers of one kind and colour: ``ids`` (n,), ``poses`` (n, 7) and ``sizes`` (n, 3) along their axes [m]."""

    kind: ShapeKind
    colour: Colour
    ids: IntArray
    poses: FloatArray
    sizes: FloatArray


class SceneMarkers:
    """Markers of the bodies, and of the ground around them when it changed. The first robot is left to
    ``~/robot_model``; further ones are boxes. Ids of bodies are constant, and those of bodies that go are deleted.
    ``namespaces``: of bodies and ground."""

    def __init__(self, session: Session) -> None:
        self._session, self._world = session, session.world
        own = session.marker_namespace
        self.namespaces = ("bodies", "ground") if own == "patches" else (f"{own}/bodies", f"{own}/ground")
        self._bodies, self._ground = self.namespaces
        self._message, self._states = ArrayMessage(), SimulatedStates(session.world)
        self._ids: dict[str, int] = {}
        self._next_id = 0
        self._shown = np.empty(0, np.int64)
        self._last: tuple[Any, ...] = ()  # what the ground of the last message depends on
        self._ground_rhythm = Rhythm()

    def write(self, header: Header, *, clear: bool) -> bytes:
        """Return the MarkerArray. ``clear``: first delete all markers of before, such as those of a node that ended, or
        whose end a subscriber missed."""
        message, stamp, frame = self._message, stamp_fields(header), header.frame_id
        message.start("markers", MarkerArray)
        for namespace in self.namespaces if clear else ():
            message.add((frame, namespace), partial(deletion, header, namespace), 1, stamp)
        groups = list(self._groups())
        shown = np.concatenate([np.empty(0, np.int64), *(group.ids for group in groups)])
        for kind, colour, ids, poses, sizes in groups:
            fields: dict[str, Any] = {**stamp, "id": ids}
            fields |= dict(zip(_FIELDS, np.concatenate([poses, sizes], axis=1).T, strict=True))
            make = partial(_marker, self._bodies, frame, TYPES[kind], colour)
            message.add((frame, kind, colour), make, len(ids), fields)
        gone = np.setdiff1d(self._shown, shown)
        delete = partial(_marker, self._bodies, frame, Marker.CUBE, TRACKED, Marker.DELETE)
        message.add((frame, "gone"), delete, len(gone), {**stamp, "id": gone})
        self._shown = shown
        self._add_ground(header, np.concatenate([np.empty((0, 7)), *(group.poses for group in groups)]), again=clear)
        return message.finish()

    def _groups(self) -> Iterator[Drawn]:
        world, first = self._world, next(iter(self._session.robot_names.prefixes()), None)
        tracked = [body for body in world.bodies.values() if body.tracked]
        poses_w = BulletCalls(world.client).poses([body.uid for body in tracked])
        tables = self._states.read(), body_table(tracked)._replace(numbers=poses_w)
        names = [name for table in tables for name in table.names]
        for name in names:
            if name not in self._ids:
                self._ids[name], self._next_id = self._next_id, self._next_id + PER_BODY
        if len(self._ids) > 2 * len(names) + 100:
            self._ids = {name: self._ids[name] for name in names}
        for table, one_colour in zip(tables, (None, TRACKED), strict=True):
            ids = np.array([self._ids[name] for name in table.names], np.int64)
            drawn = np.array([name != first for name in table.names], np.bool_)
            poses = table.numbers[:, :7].copy()
            poses[:, :3] += rotated(poses[:, 3:], table.centres)
            for kind, colour in COLOURS.items():
                rows = np.flatnonzero(drawn & (table.kinds == kind))
                if len(rows):
                    yield from parts_of(kind, one_colour or colour, ids[rows], poses[rows], table.dimensions[rows])

    def _add_ground(self, header: Header, poses: FloatArray, *, again: bool) -> None:
        """Add the ground if it or the place of the bodies has changed, or ``again``."""
        world = self._world
        if not self._ground_rhythm.is_due(self._session.clock.steady(), GROUND_RATE, now=again):
            return
        window = window_around(poses, world.terrain)
        moving = world.terrain.moving(world.time)
        patches_w = world.patches().table().points_w
        seen = (window, world.terrain.revision, header.frame_id, patches_w.tobytes())
        if window is None or (seen == self._last and not moving and not again):
            return
        self._last = seen
        points = ground_points(window, world.terrain, world.time, patches_w)
        make = partial(_marker, self._ground, header.frame_id, Marker.TRIANGLE_LIST, GROUND, points=len(points))
        fields = {**stamp_fields(header), "id": 0, "points": points[None]}
        self._message.add((header.frame_id, "ground", len(points)), make, 1, fields)


def parts_of(
    kind: ShapeKind, colour: Colour, ids: IntArray, poses: FloatArray, dimensions: FloatArray
) -> Iterator[Drawn]:
    """Yield the markers of bodies of one kind, by their ``poses`` (n, 7) and ``dimensions`` (n, 1+) [m]."""
    if kind == BOX:
        yield Drawn(BOX, colour, ids, poses, dimensions)
    elif kind == BALL:
        yield Drawn(BALL, colour, ids, poses, np.repeat(2.0 * dimensions[:, :1], 3, axis=1))
    else:
        height, width = dimensions[:, :1], 2.0 * dimensions[:, 1:2]
        yield Drawn(CYLINDER, colour, ids, poses, np.concatenate([width, width, height], axis=1))
        if kind == CAPSULE:
            along = rotated(poses[:, 3:], np.pad(0.5 * height, ((0, 0), (2, 0))))
            for place, side in enumerate((1.0, -1.0), 1):
                ends = np.concatenate([poses[:, :3] + side * along, poses[:, 3:]], axis=1)
                yield Drawn(BALL, colour, ids + place, ends, np.repeat(width, 3, axis=1))


def _marker(
    namespace: str, frame_id: str, kind: int, colour: Colour, action: int = Marker.ADD, points: int = 0
) -> Marker:
    marker = Marker(ns=namespace, type=kind, action=action, frame_locked=True, points=[Point()] * points)
    marker.header.frame_id = frame_id
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
    return marker


def shown_robot(world: World, names: RobotNames) -> tuple[Body | None, str]:
    """Return the first robot and the prefix of its frames on ``/tf``; None = there is no robot."""
    robot, prefix = next(iter(names.prefixes().items()), ("", ""))
    return world.bodies.get(robot), prefix


def robot_model(shown: tuple[Body | None, str]) -> String:
    """Return the URDF of a robot with the names of its frames, and with the files of its meshes; empty without one."""
    body, prefix = shown
    return String(data="" if body is None else shown_urdf(body.urdf or "", prefix))


def shown_urdf(urdf: str, prefix: str) -> str:
    """Return a URDF text or file for a display: links have the ``prefix`` of their frames, files of meshes are named by
    ``file://``, and links without visuals show what they collide with. Empty if the file is gone."""
    try:
        robot = ElementTree.fromstring(urdf_text(urdf))
    except InputError:  # the file may have been deleted since the robot was loaded
        return ""
    folder = None if is_text(urdf) else Path(urdf).absolute().parent
    for link in robot.findall("link"):
        link.set("name", prefix + link.get("name", ""))
        if link.find("visual") is None:
            for collision in link.findall("collision"):
                link.append(shown := ElementTree.Element("visual"))
                shown.extend(collision.findall(tag)[0] for tag in ("origin", "geometry") if collision.findall(tag))
    for end in (end for joint in robot.findall("joint") for tag in ("parent", "child") for end in joint.findall(tag)):
        end.set("link", prefix + end.get("link", ""))
    for file in (*robot.iter("mesh"), *robot.iter("texture")):
        with suppress(InputError):  # a missing file is left to the display, which says so
            file.set("filename", f"file://{named_file(file.get('filename', ''), folder)}")
    return ElementTree.tostring(robot, encoding="unicode")
