"""Conversion of messages about bodies and joints to values of the core, and the names of robots' joints and links.

Invalid messages raise `InputError`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from itertools import takewhile
from typing import Any, NamedTuple

from shape_msgs.msg import SolidPrimitive

from smartmesh_ros.errors import InputError, listed, require_body_name, suggestion
from smartmesh_ros.ground.body_shapes import link_names
from smartmesh_ros.ground.quaternions import rotate
from smartmesh_ros.ground.shapes import SHAPES, Shape, ShapeKind, Solid, shape_from, shape_of
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.joints import JointCommand
from smartmesh_ros.world.world import World


class BodyInput(NamedTuple):
    """A tracked body: its name, state and bounding radius [m], 0 = the default. ``stated``: the state's velocity is
    stated even if it is zero. ``solid``: what it is in place of a sphere, None = nothing else is said."""

    name: str
    state: BodyState
    radius: float
    stated: bool = False
    solid: Solid | None = None


def bodies_from(message: Any) -> list[BodyInput]:
    """Convert a TrackedBodyArray message; one invalid body refuses the whole message."""
    bodies = []
    for body in message.bodies:
        state, solid = state_from(body.pose, body.twist), None
        if body.shape:
            _kind_of(body.shape, f" of {body.id!r}")
            solid = shape_of(ShapeKind(body.shape), body.dimensions.tolist(), body.centre.tolist())
        bodies.append(BodyInput(body.id, state, float(body.radius), solid=solid))
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


def shape_of_primitive(primitive: SolidPrimitive) -> Shape:
    """Convert a SolidPrimitive, or a capsule in one, to a shape. Numbers and dimensions are those of `ShapeKind`."""
    return shape_from(_kind_of(primitive.type), primitive.dimensions)


def _kind_of(number: Any, of_whom: str = "") -> type[Shape]:
    made = SHAPES.get(number)
    if made is None:
        known = ", ".join(f"{kind.__name__.upper()} ({each:d})" for each, kind in SHAPES.items())
        raise InputError("shape", f"shape type {number}{of_whom} is not supported; use one of {known}")
    return made


def primitive_of(shape: Shape) -> SolidPrimitive:
    """Convert a shape to a SolidPrimitive, or to a capsule in one."""
    return SolidPrimitive(type=int(shape.kind), dimensions=[*shape.dimensions.values()])


def require_distinct(names: list[str]) -> None:
    """Raise `InputError` unless each body of a message has a name of its own."""
    seen: set[str] = set()
    for name in names:
        require_body_name(name)
        if name in seen:
            raise InputError("duplicate_id", f"body {name!r} is in the message twice; names must be distinct")
        seen.add(name)


def require_once(name: str, counts: Mapping[str, int]) -> None:
    """Raise `InputError` if a call names a body more than once; ``counts``: how often, by name."""
    if counts[name] > 1:
        raise InputError("duplicate_id", f"{name!r} is named {counts[name]} times; name each body once")


class RobotNames:
    """Puts ``<robot>/`` before the names of a robot's joints and links, or nothing.

    A robot whose names no other robot without prefix has, and no body that was there before, keeps the names of its
    URDF, which robot_state_publisher and controllers expect. Its names stay while it is there, whatever robots come and
    go. ``always``: every robot has a prefix.
    """

    def __init__(self, world: World, *, always: bool) -> None:
        self._world, self._always = world, always
        self._robots: list[Body] = []
        self._prefixes: dict[str, str] = {}

    def prefixes(self) -> dict[str, str]:
        """Return the prefix of each robot, in order of spawning."""
        robots = [body for body in self._world.bodies.values() if body.is_robot]
        if robots != self._robots:
            kept = [body for body in robots if body in self._robots]
            new = [body for body in robots if body not in kept]
            taken = {name for body in kept if not self._prefixes[body.name] for name in self._names(body)}
            chosen = {body.name: self._prefixes[body.name] for body in kept}
            bodies = [body.name for body in self._world.bodies.values() if body.simulated]
            for body in new:
                names = self._names(body)
                others = taken.union(takewhile(body.name.__ne__, bodies))
                chosen[body.name] = f"{body.name}/" if self._always or names & others else ""
                taken |= names if not chosen[body.name] else set()
            self._robots, self._prefixes = robots, {body.name: chosen[body.name] for body in robots}
        return self._prefixes

    def _names(self, body: Body) -> set[str]:
        """Return the names of a robot's joints that move, driven surfaces and links, which messages have."""
        return {*body.joints, *body.surfaces, *link_names(self._world.client, body.uid)}


def joint_commands_from(message: Any, world: World, prefixes: Mapping[str, str]) -> list[tuple[str, str, JointCommand]]:
    """Return the commands (robot, joint, command) of a JointState; one unknown joint or invalid number refuses all.

    A joint is named ``<robot>/<joint>``, or ``<joint>`` if its robot is the only one or, by ``prefixes``, has names
    without prefix; these are distinct. ``position``, ``velocity`` and ``effort`` each have one number per name, or
    none; NaN is no number for this joint, as ros2_control's topic bridges send for interfaces that they do not command.
    `JointCommand` defines the combinations. A joint that has nothing but NaN keeps its command. A driven surface of a
    robot, such as a track, is named as a joint and takes a velocity alone [m/s].
    """
    names, count = list(message.name), len(message.name)
    if count == 0:
        raise InputError("length", "a joint command names no joint")
    fields = {field: list(getattr(message, field)) for field in ("position", "velocity", "effort")}
    for field, values in fields.items():
        if len(values) not in (0, count):
            raise InputError("length", f"{len(values)} of {field} for {count} joints; there must be as many, or none")
    commands = []
    for index, (robot, joint) in enumerate(_joints(names, world, prefixes)):
        sent = {field: values[index] for field, values in fields.items() if values}
        given = {field: value for field, value in sent.items() if not math.isnan(value)}
        if given or not sent:
            command = JointCommand(**given)
            world.require_command(robot, joint, command)
            commands.append((robot, joint, command))
    return commands


def tracked_joints_from(
    message: Any, robots: Mapping[str, Collection[str]]
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the positions and velocities by robot and joint of a JointState for tracked robots, by their joints. A
    joint is named ``<robot>/<joint>``, or ``<joint>``, of all robots that have one. Others are left out, as a message
    may be of a whole machine. Raises `InputError` if lengths differ."""
    count = len(message.name)
    if len(message.position) != count or len(message.velocity) not in (0, count):
        raise InputError("length", f"{len(message.position)} of position and {len(message.velocity)} of velocity for "
                         f"{count} joints; there must be as many, of velocity also none")  # fmt: skip
    speeds = message.velocity or [0.0] * count
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for name, *values in zip(message.name, message.position, speeds, strict=True):
        for robot, joints in robots.items():
            joint = name.removeprefix(f"{robot}/")
            if joint in joints:
                found.setdefault(robot, {})[joint] = (values[0], values[1])
    return found


def _joints(names: list[str], world: World, prefixes: Mapping[str, str]) -> list[tuple[str, str]]:
    robots = {robot: (*world.bodies[robot].joints, *world.bodies[robot].surfaces) for robot in prefixes}
    short = {
        joint: robot for robot, prefix in prefixes.items() if not prefix or len(robots) == 1 for joint in robots[robot]
    }
    found, unknown = [], []
    for name in names:
        robot, _, joint = name.partition("/")
        if joint in robots.get(robot, ()):
            found.append((robot, joint))
        elif name in short:
            found.append((short[name], name))
        else:
            unknown.append(name)
    if unknown:
        there = [f"{robot}/{joint}" for robot, joints in robots.items() for joint in joints]
        words = f"{len(unknown)} of {len(names)} joints are unknown: {listed([*map(repr, unknown)], 20)}"
        words += suggestion(unknown[0], [*short, *there])
        raise InputError("unknown_joint", f"{words}; there is {listed(there, 20) or 'no robot with joints'}")
    if len(set(found)) < len(found):
        raise InputError("duplicate_id", "a joint is commanded twice in one message; name each once")
    return found
