"""Tracked robots: the solids of a robot's links, where its root link and its joints dictate them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.bullet import own_client
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Hull, ShapeKind, Solid, Sphere
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.ground.transform import Transform, fixed_to
from smartmesh_ros.world.bodies import BodyFactory
from smartmesh_ros.world.link_frames import LinkFrames
from smartmesh_ros.world.robots.prepared import prepare_robot


class TrackedPart(NamedTuple):
    """A solid of a tracked robot, by its ``name`` as a tracked body, in a ``state``."""

    name: str
    solid: Solid
    state: BodyState


class _Part(NamedTuple):
    """A solid at a ``place`` in the frame of the ``link``, the root = 0."""

    name: str
    solid: Solid
    link: int
    place: Transform


class TrackedRobot:
    """A robot whose root link's frame and joints are dictated, from a URDF (text or file). Raises `InputError` if it is
    refused.

    Each collision shape is a tracked body ``<name>.<link>``, of a link with several also ``<name>.<link>.1`` and so on,
    with ``.`` for each ``/`` of a link, which no name of a body has. ``joints``: those that move, PyBullet's
    indices by name. Meshes are their convex hulls.
    """

    def __init__(self, name: str, urdf: str) -> None:
        with own_client() as client:
            body = BodyFactory(client, PhysicsConfig()).robot(name, prepare_robot(urdf), BodyState())
            self._frames = LinkFrames(client, body.uid)
            self.joints = body.joints
            self._values = {joint: (body.starts.get(joint, 0.0), 0.0) for joint in body.joints}
            self._parts: list[_Part] = []
            for index, shape in body.shapes.items():
                centre = Transform(*client.getDynamicsInfo(body.uid, index)[3:5])
                for place, part in enumerate(shape.parts):
                    full = f"{name}.{body.links[index].replace('/', '.')}" + (f".{place}" if place else "")
                    placed = centre.then(Transform(part.offset, part.orientation))
                    self._parts.append(_Part(full, _solid(part), index + 1, placed))

    def move(self, joints: Mapping[str, tuple[float, float]]) -> None:
        """Set positions and velocities of some joints [rad, rad/s or m, m/s]. Raises `InputError` as `require`."""
        self.require(joints)
        self._values |= joints

    def require(self, joints: Mapping[str, tuple[float, float]]) -> None:
        """Raise `InputError` if there is no such joint, or a number is not finite."""
        for joint, values in joints.items():
            if joint not in self.joints:
                there = ", ".join(self.joints) or "none"
                raise InputError("unknown_joint", f"the tracked robot has no joint {joint!r}; it has {there}")
            if not all(map(math.isfinite, values)):
                raise InputError("non_finite", f"joint {joint!r} is at {values}; both must be finite")

    def parts(self, root: BodyState) -> Iterator[TrackedPart]:
        """Yield the parts for a ``state`` of the root link's frame, with their velocities: those of the root and of the
        joints."""
        states = self._frames.states(root, {index: self._values[joint] for joint, index in self.joints.items()})
        for part in self._parts:
            yield TrackedPart(part.name, part.solid, fixed_to(states[part.link], part.place))


def _solid(part: BodyShape) -> Solid:
    """Return the solid of a shape of one part."""
    (hx, hy, hz), rounding = part.half, part.rounding
    if part.kind == ShapeKind.HULL:
        return Hull(tuple((a, b, c) for a, b, c in part.vertices.tolist()))
    if part.kind == ShapeKind.BALL:
        return Sphere(rounding)
    if part.kind == ShapeKind.BOX:
        return Box(2.0 * (hx + rounding), 2.0 * (hy + rounding), 2.0 * (hz + rounding))
    if part.kind == ShapeKind.CYLINDER:
        return Cylinder(height=2.0 * (hz + rounding), radius=hx + rounding)
    return Capsule(height=2.0 * hz, radius=rounding)
