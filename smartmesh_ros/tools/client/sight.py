"""The shown state of bodies, patches and contacts, as plain values, and its topics; and what a client reads from
``~/scene``: the ground, if it has no map of it, and tracked bodies, whose poses may be on topics and in frames that it
does not know."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, ContactArray, TrackedBody, TrackedBodyArray
from visualization_msgs.msg import Marker

from smartmesh_ros.ground.limits import require_possible
from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.node.inputs.checked_messages import message_from
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.client.patch import Patch

# Radius of bodies of unknown shape [m].
DEFAULT_RADIUS = 0.25
# Distance beside a body at which a click still hits it [m]. Higher values make small bodies easier to hit.
CLICK_MARGIN = 0.05
# Types of the node's topics that `Sight.take` reads. ~/odometry has a message for each robot.
KINDS = {
    "body_descriptions": BodyDescriptionArray,
    "body_states": TrackedBodyArray,
    "tracked_bodies": TrackedBodyArray,
    "body_poses": PoseArray,
    "joint_states": JointState,
    "odometry": Odometry,
    "contacts": ContactArray,
}


class Pose(NamedTuple):
    """Position [m] and orientation (w, x, y, z), the order of viser, in the terrain's frame."""

    position: Vector
    wxyz: tuple[float, float, float, float]

    def inside(self, points_w: FloatArray) -> FloatArray:
        """Return points (n, 3) [m] in the frame that has this pose."""
        w, x, y, z = self.wxyz
        return rotated(np.array([-x, -y, -z, w]), points_w - self.position)


@dataclass
class Sight:
    """The newest state of everything but the terrain, in the terrain's ``frame``. ``poses``, ``appearances`` and
    ``patches`` by body; ``boxes``: middle, in the body's axes, and edges [m] of bodies that are boxes, and of the boxes
    around the links of robots; ``asleep``: simulated bodies without any velocity; ``heard``: bodies whose poses are on
    ~/tracked_bodies or ~/body_poses; ``bases``: poses of robots' base links and of decks, by frame as in ~/odometry;
    ``joints``: positions [rad, m] by name as in ~/joint_states; ``contacts`` (n, 7): position [m], normal and force [N]
    of each."""

    frame: str = ""
    poses: dict[str, Pose] = field(default_factory=dict)
    boxes: dict[str, tuple[Vector, Vector]] = field(default_factory=dict)
    appearances: dict[str, BodyDescription] = field(default_factory=dict)
    asleep: frozenset[str] = frozenset()
    heard: set[str] = field(default_factory=set)
    bases: dict[str, Pose] = field(default_factory=dict)
    joints: dict[str, float] = field(default_factory=dict)
    patches: dict[str, Patch] = field(default_factory=dict)
    contacts: FloatArray = field(default_factory=lambda: np.zeros((0, 7)))

    @property
    def bodies(self) -> tuple[FloatArray, FloatArray]:
        """Positions (B, 3) and radii (B,) [m] of all bodies, in the order of ``poses``."""
        positions = np.array([pose.position for pose in self.poses.values()]).reshape(-1, 3)
        return positions, np.array([self.radius_of(name) for name in self.poses])

    @property
    def has_unheard(self) -> bool:
        """True if the poses of tracked bodies are on other topics, or in other frames."""
        return any(body.tracked and name not in self.heard for name, body in self.appearances.items())

    def shape_of(self, name: str) -> tuple[int, tuple[float, ...]]:
        """Return a body's kind of shape and dimensions [m] as of BodyDescription, for a robot of the box around its
        links."""
        known = self.appearances.get(name)
        if known is not None and known.dimensions:
            return known.shape, tuple(known.dimensions)
        if known is not None and name in self.boxes:
            return BodyDescription.BOX, self.boxes[name][1]
        return BodyDescription.SPHERE, (DEFAULT_RADIUS,)

    def radius_of(self, name: str) -> float:
        """Return the radius [m] of a body's bounding sphere around its centre."""
        kind, sizes = self.shape_of(name)
        if kind == BodyDescription.BOX:
            return 0.5 * math.hypot(*sizes)
        if kind == BodyDescription.CYLINDER:
            return math.hypot(0.5 * sizes[0], sizes[1])
        return 0.5 * sizes[0] + sizes[1] if kind == BodyDescription.CAPSULE else sizes[0]

    def placed(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Return the middles (n, 3) [m] of bodies, which of boxes may be beside the centres of mass, and their
        orientations (n, 4)."""
        positions, turns = (np.array(values) for values in zip(*(self.poses[name] for name in names), strict=True))
        offsets = np.array([self.boxes[name][0] if name in self.boxes else (0.0, 0.0, 0.0) for name in names])
        return positions + rotated(np.roll(turns, -1, axis=1), offsets), turns

    def hit(self, origin: FloatArray, direction: FloatArray) -> str | None:
        """Return the nearest body whose bounding sphere a ray (unit ``direction``) hits, or None."""
        positions, radii = self.bodies
        along = (positions - origin) @ direction
        beside = np.linalg.norm(positions - origin - along[:, None] * direction, axis=1)
        hit = np.flatnonzero((along > 0.0) & (beside <= radii + CLICK_MARGIN))
        return list(self.poses)[hit[along[hit].argmin()]] if hit.size else None

    def take(self, topic: str, data: bytes) -> None:
        """Update with a message of a topic of `KINDS`. Raises `InputError` if it is malformed, or the node refuses its
        bodies."""
        message = message_from(data, KINDS[topic])
        if topic == "body_descriptions":
            gone = self.appearances.keys() - {body.id for body in message.bodies}
            for frame in [frame for frame in self.bases if frame.partition("/")[0] in gone]:
                del self.bases[frame]  # a robot that comes again may have the short names of its URDF
            self.appearances = {body.id: body for body in message.bodies}
            self.poses = {name: pose for name, pose in self.poses.items() if name in self.appearances}
            self.heard &= self.appearances.keys()
        elif topic == "joint_states":
            self.joints = dict(zip(message.name, message.position, strict=False))
        elif topic == "odometry":
            self.bases[message.child_frame_id] = _pose(message.pose.pose)
        elif topic == "contacts":
            rows = [(*_xyz(c.position), *_xyz(c.normal), c.normal_force) for c in message.contacts]
            self.contacts = np.array(rows).reshape(-1, 7)
        elif topic == "body_states":
            self.frame = message.header.frame_id
            # It has all simulated bodies: others are gone, or tracked.
            tracked = {name for name, body in self.appearances.items() if body.tracked}
            self.poses = {name: pose for name, pose in self.poses.items() if name in tracked}
            self._place(message.bodies)
            # Only the velocities of sleeping bodies are exactly zero.
            moving = (body.id for body in message.bodies if any(_xyz(body.twist.linear) + _xyz(body.twist.angular)))
            self.asleep = frozenset(body.id for body in message.bodies) - frozenset(moving)
        elif message.header.frame_id.strip("/") in ("", self.frame):
            from smartmesh_ros.node.inputs.conversions import bodies_from, poses_from  # imports PyBullet

            for given in poses_from(message) if topic == "body_poses" else bodies_from(message):
                require_possible(given.name, given.state)
            bodies = _bodies_of(message)
            self._place(bodies)
            self.heard |= {body.id for body in bodies}

    def take_tracked(self, drawn: Sequence[Pose]) -> None:
        """Place the tracked bodies that are not `heard` by the markers of all tracked bodies on ~/scene, unless these
        are of other bodies than the newest descriptions. They are in the order of these; the two ends of each capsule
        follow all bodies."""
        tracked = [body for body in self.appearances.values() if body.tracked]
        if len(drawn) == sum(3 if body.shape == BodyDescription.CAPSULE else 1 for body in tracked):
            there = zip(tracked, drawn, strict=False)
            self.poses |= {body.id: pose for body, pose in there if body.id not in self.heard}

    def _place(self, bodies: Iterable[TrackedBody]) -> None:
        for body in bodies:
            self.poses[body.id] = _pose(body.pose)
            if body.shape == TrackedBody.SHAPE_BOX:
                self.boxes[body.id] = tuple(body.centre.tolist()), tuple(body.dimensions.tolist())
            else:
                self.boxes.pop(body.id, None)


def _bodies_of(message: Any) -> list[TrackedBody]:
    """Return the bodies of a message; a PoseArray numbers its own."""
    if isinstance(message, PoseArray):
        return [TrackedBody(id=f"body_{number}", pose=pose) for number, pose in enumerate(message.poses)]
    return list(message.bodies)


def _xyz(message: Any) -> Vector:
    return message.x, message.y, message.z


def _pose(message: Any) -> Pose:
    turn = message.orientation
    return Pose(_xyz(message.position), (turn.w, turn.x, turn.y, turn.z))


def drawn_scene(scene: bytes) -> tuple[FloatArray | None, list[Pose]]:
    """Return the corners (n, 3) [m] of the triangles of ground in a MarkerArray, none if the ground is gone, None = it
    has not changed; and the markers of tracked bodies, which alone are translucent. Raises `InputError` if the bytes
    are malformed.

    Reads the bytes, because rclpy takes 50 ms to make an object of each corner."""
    reader, ground, tracked = CdrReader(scene), None, list[Pose]()
    for _ in range(reader.count(1)):
        _skip_header(reader)
        namespace = reader.text()
        _, kind, action = reader.numbers("i", 3)
        x, y, z, qx, qy, qz, qw, *_ = reader.numbers("d", 10)
        *_, alpha = reader.numbers("f", 4)
        reader.skip(4, 2)  # lifetime
        reader.skip(1)  # frame_locked
        points = reader.sequence("f8", 3)
        reader.sequence("f4", 4)  # colours
        reader.text()  # texture_resource
        _skip_header(reader)  # of the texture
        reader.text(), reader.sequence("u1")  # its format and data
        reader.sequence("f4", 2)  # uv_coordinates
        reader.text(), reader.text(), reader.text()  # text, mesh_resource, name of the mesh file
        reader.sequence("u1"), reader.skip(1)  # its data, mesh_use_embedded_materials
        if action == Marker.DELETEALL and namespace.endswith("ground"):
            ground = np.empty((0, 3))
        if action != Marker.ADD:
            continue
        if kind == Marker.TRIANGLE_LIST:
            ground = np.asarray(points, np.float64)
        elif alpha < 1.0:
            tracked.append(Pose((x, y, z), (qw, qx, qy, qz)))
    return ground, tracked


def _skip_header(reader: CdrReader) -> None:
    reader.numbers("I", 2), reader.text()
