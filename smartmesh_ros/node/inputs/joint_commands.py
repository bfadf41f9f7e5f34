"""Joint commands from sensor_msgs/JointState."""

from __future__ import annotations

from typing import Any, NamedTuple

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.joints import JointCommand
from smartmesh_ros.physics.world import World


class CommandedJoint(NamedTuple):
    """A command to one joint of a robot."""

    robot: str
    joint: str
    command: JointCommand


def joint_commands_from(message: Any, world: World) -> list[CommandedJoint]:
    """Return the commands of a JointState; one unknown joint or invalid number refuses the whole message.

    A joint is named ``<robot>/<joint>``, or ``<joint>`` if the world has one robot. ``position``, ``velocity`` and
    ``effort`` each have one number per name, or none; `JointCommand` defines their combinations.
    """
    names, count = list(message.name), len(message.name)
    if count == 0:
        raise InputError("length", "a joint command names no joint")
    fields = {field: list(getattr(message, field)) for field in ("position", "velocity", "effort")}
    for field, values in fields.items():
        if len(values) not in (0, count):
            raise InputError("length", f"{len(values)} of {field} for {count} joints; there must be as many, or none")
    joints = _joints(names, world)
    commands = []
    for index, (robot, joint) in enumerate(joints):
        given = {field: values[index] for field, values in fields.items() if values}
        commands.append(CommandedJoint(robot, joint, JointCommand(**given)))
    return commands


def _joints(names: list[str], world: World) -> list[tuple[str, str]]:
    robots = {body.name: body.joints for body in world.bodies.values() if body.is_robot}
    alone = next(iter(robots)) if len(robots) == 1 else ""
    found, unknown = [], []
    for name in names:
        robot, _, joint = name.partition("/")
        if joint in robots.get(robot, {}):
            found.append((robot, joint))
        elif name in robots.get(alone, {}):
            found.append((alone, name))
        else:
            unknown.append(name)
    if unknown:
        there = [f"{robot}/{joint}" for robot, joints in robots.items() for joint in joints]
        shown = ", ".join(there[:20]) + (f" and {len(there) - 20} more" if len(there) > 20 else "")
        raise InputError(
            "unknown_joint",
            f"{len(unknown)} of {len(names)} joints are unknown: {', '.join(map(repr, unknown[:20]))}; "
            f"there is {shown or 'no robot with joints'}",
        )
    if len(set(found)) < len(found):
        raise InputError("duplicate_id", "a joint is commanded twice in one message; name each once")
    return found
