"""``~/scene``: the ground and the bodies on it, for RViz; ``~/robot_model``: the first robot, for its RobotModel."""

from __future__ import annotations

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
from smartmesh_ros.world.robots.description import is_text, named_file, urdf_text, xml_of
from smartmesh_ros.world.states import SimulatedStates, body_table
from smartmesh_ros.world.world import World

BALL, BOX, CYLINDER, CAPSULE = ShapeKind.BALL, ShapeKind.BOX, ShapeKind.CYLINDER, ShapeKind.CAPSULE
# Colours of bodies by their kinds, of tracked bodies, and of the ground (r, g, b, a).
COLOURS = np.zeros((CAPSULE + 1, 4))
COLOURS[[BALL, BOX, CYLINDER, CAPSULE]] = (
    (0.2, 0.36, 0.66, 1.0), (0.55, 0.23, 0.47, 1.0), (0.12, 0.45, 0.38, 1.0), (0.47, 0.37, 0.16, 1.0)
)  # fmt: skip
TRACKED, GROUND = (0.6, 0.6, 0.6, 0.5), (0.45, 0.5, 0.42, 1.0)
# Highest rate at which ground that changes is drawn [Hz].
GROUND_RATE = 10.0
# Markers of a body: a capsule is a cylinder and two balls.
PER_BODY = 3
_FIELDS = (
    *fields_of("pose.position"), *fields_of("pose.orientation", "xyzw"), *fields_of("scale"),
    *fields_of("color", "rgba"),
)  # fmt: skip


class Drawn(NamedTuple):
    """Markers of bodies: ``ids`` and ``types`` (n,), ``poses`` (n, 7), ``sizes`` (n, 3) along their axes [m], and
    ``colours`` (n, 4)."""

    ids: IntArray
    types: IntArray
    poses: FloatArray
    sizes: FloatArray
    colours: FloatArray


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
        drawn, places_w = self._drawn()
        gone = np.setdiff1d(self._shown, drawn.ids)
        self._shown = drawn.ids
        numbers = np.concatenate(drawn[2:], axis=1)
        fields: dict[str, Any] = {**stamp, "id": drawn.ids, "type": drawn.types}
        make = partial(_marker, self._bodies, frame, Marker.CUBE)
        message.add(frame, make, len(numbers), fields | dict(zip(_FIELDS, numbers.T, strict=True)))
        message.add(frame, make, len(gone), {**stamp, "id": gone, "action": Marker.DELETE})
        self._add_ground(header, places_w, again=clear)
        return message.finish()

    def _drawn(self) -> tuple[Drawn, FloatArray]:
        """Return the markers of the bodies, and the positions (n, 3) [m] of all bodies, the first robot among them."""
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
        columns = zip(*((one.kinds, one.dimensions, one.centres, one.numbers[:, :7]) for one in tables), strict=True)
        kinds, dimensions, centres, poses = map(np.concatenate, columns)
        somewhere = np.isfinite(poses).all(axis=1)
        places_w = poses[somewhere, :3]
        shown = np.array([name != first for name in names], np.bool_) & somewhere
        kinds, dimensions, centres, poses = (column[shown] for column in (kinds, dimensions, centres, poses))
        ids = np.array([self._ids[name] for name in names], np.int64)[shown]
        poses[:, :3] += rotated(poses[:, 3:], centres)
        colours, capsule = COLOURS[kinds], kinds == CAPSULE
        colours[np.repeat((False, True), [len(table.names) for table in tables])[shown]] = TRACKED
        height, width = dimensions[:, :1], 2.0 * dimensions[:, 1:2]
        sizes = np.concatenate([width, width, height], axis=1)
        sizes[kinds == BOX], sizes[kinds == BALL] = dimensions[kinds == BOX], 2.0 * dimensions[kinds == BALL, :1]
        # Types of markers have the numbers of kinds of shape.
        parts = [Drawn(ids, np.where(capsule, CYLINDER, kinds), poses, sizes, colours)]
        along = rotated(poses[capsule, 3:], np.pad(0.5 * height[capsule], ((0, 0), (2, 0))))
        for place, side in enumerate((1.0, -1.0), 1):
            ends = np.concatenate([poses[capsule, :3] + side * along, poses[capsule, 3:]], axis=1)
            balls = np.full(len(ends), BALL), ends, np.repeat(width[capsule], 3, axis=1)
            parts.append(Drawn(ids[capsule] + place, *balls, colours[capsule]))
        return Drawn(*map(np.concatenate, zip(*parts, strict=True))), places_w

    def _add_ground(self, header: Header, places_w: FloatArray, *, again: bool) -> None:
        """Add the ground if it or the place of the bodies has changed, or ``again``."""
        world = self._world
        if not self._ground_rhythm.is_due(self._session.clock.steady(), GROUND_RATE, now=again):
            return
        window = window_around(places_w, world.terrain)
        moving = world.terrain.moving(world.time)
        patches_w = world.patches().table().points_w
        seen = (window, world.terrain.revision, header.frame_id, patches_w.tobytes())
        if window is None or (seen == self._last and not moving and not again):
            return
        self._last = seen
        points = ground_points(window, world.terrain, world.time, patches_w)
        make = partial(_marker, self._ground, header.frame_id, Marker.TRIANGLE_LIST, len(points))
        fields = {**stamp_fields(header), "id": 0, "points": points[None]}
        self._message.add((header.frame_id, "ground", len(points)), make, 1, fields)


def _marker(namespace: str, frame_id: str, kind: int, points: int = 0) -> Marker:
    marker = Marker(ns=namespace, type=kind, frame_locked=True, points=[Point()] * points)
    marker.header.frame_id = frame_id
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = GROUND
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
    ``file://``, and links without visuals show what they collide with. Empty if the file is gone, or no URDF."""
    try:
        robot = xml_of(urdf_text(urdf))
    except InputError:  # the file may have been deleted or changed since the robot was loaded
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
