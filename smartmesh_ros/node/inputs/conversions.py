"""Pure functions that convert messages about bodies to values of the core. Invalid messages raise `InputError`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

from shape_msgs.msg import SolidPrimitive

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.ground.state import BodyState


class BodyInput(NamedTuple):
    """A tracked body: its name, state and bounding radius [m], 0 = the default. ``stated``: the state's velocity is
    stated even if it is zero."""

    name: str
    state: BodyState
    radius: float
    stated: bool = False


def bodies_from(message: Any) -> list[BodyInput]:
    """Convert a TrackedBodyArray message; one invalid body refuses the whole message."""
    bodies = []
    for body in message.bodies:
        if not (math.isfinite(body.radius) and body.radius >= 0.0):
            raise InputError("geometry", f"radius of {body.id!r} is {body.radius} m; it must be zero or more")
        bodies.append(BodyInput(body.id, state_from(body.pose, body.twist), float(body.radius)))
    require_distinct([body.name for body in bodies])
    return bodies


def poses_from(message: Any) -> list[BodyInput]:
    """Convert a PoseArray message; body i gets the name ``body_<i>``."""
    return [BodyInput(f"body_{index}", state_from(pose), 0.0) for index, pose in enumerate(message.poses)]


def odometry_from(message: Any) -> BodyState:
    """Convert an Odometry message, its twist rotated from the body's frame into the frame of the pose."""
    state = state_from(message.pose.pose, message.twist.twist)
    linear, angular = (rotate(state.orientation, vector) for vector in (state.linear, state.angular))
    return replace(state, linear=linear, angular=angular)


def state_from(pose: Any, twist: Any = None) -> BodyState:
    """Convert a pose and a twist. `BodyState` checks that they are finite, and normalises the quaternion."""
    p, q = pose.position, pose.orientation
    linear = angular = (0.0, 0.0, 0.0)
    if twist is not None:
        linear = (twist.linear.x, twist.linear.y, twist.linear.z)
        angular = (twist.angular.x, twist.angular.y, twist.angular.z)
    return BodyState((p.x, p.y, p.z), (q.x, q.y, q.z, q.w), linear, angular)


# Shapes by the types of SolidPrimitive, and which of its dimensions are theirs, in order.
SOLIDS: dict[int, tuple[type[Shape], tuple[int, ...]]] = {
    SolidPrimitive.SPHERE: (Sphere, (SolidPrimitive.SPHERE_RADIUS,)),
    SolidPrimitive.BOX: (Box, (SolidPrimitive.BOX_X, SolidPrimitive.BOX_Y, SolidPrimitive.BOX_Z)),
    SolidPrimitive.CYLINDER: (Cylinder, (SolidPrimitive.CYLINDER_RADIUS, SolidPrimitive.CYLINDER_HEIGHT)),
}


def shape_from(primitive: Any) -> Shape:
    """Convert a SolidPrimitive to a shape of the core."""
    dimensions = [float(value) for value in primitive.dimensions]
    if primitive.type not in SOLIDS:
        raise InputError("shape", f"shape type {primitive.type} is not supported; use SPHERE, BOX or CYLINDER")
    made, order = SOLIDS[primitive.type]
    if len(dimensions) != len(order):
        name = made.__name__.upper()
        raise InputError("shape", f"{name} needs {len(order)} dimensions, not {len(dimensions)}")
    return made(*(dimensions[index] for index in order))


def require_distinct(names: list[str]) -> None:
    """Raise `InputError` unless each body of a message has a name of its own."""
    seen: set[str] = set()
    for name in names:
        if not name or "/" in name:
            raise InputError("empty_id", f"{name!r} cannot name a body; a name is not empty and has no '/'")
        if name in seen:
            raise InputError("duplicate_id", f"body {name!r} is in the message twice; names must be distinct")
        seen.add(name)
