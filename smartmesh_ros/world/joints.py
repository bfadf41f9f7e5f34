"""Commands and readings of robots' joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import pybullet as pb

from smartmesh_ros.errors import InputError, as_float
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST_SPIN, STRONGEST

# Effort limit of a joint whose URDF gives none [Nm or N].
DEFAULT_EFFORT = 100.0


@dataclass(frozen=True, kw_only=True)
class JointCommand:
    """How one joint is driven until the next command; units are rad, rad/s and Nm, or m, m/s and N.

    - ``position`` given: position control, with ``velocity`` (default 0) as the target's velocity.
    - ``velocity`` alone: velocity control.
    - ``effort`` with either: effort limit of the controller; without it, the limit of the URDF or `DEFAULT_EFFORT`.
    - ``effort`` alone: this effort in every step, whatever the joint does.
    - nothing: the joint turns freely, but for its friction.

    With ``position`` or ``velocity`` the joint moves no faster than the URDF's limit of velocity.
    """

    position: float | None = None
    velocity: float | None = None
    effort: float | None = None

    def __post_init__(self) -> None:
        for name, most in (("position", FARTHEST_BODY), ("velocity", FASTEST_SPIN), ("effort", STRONGEST)):
            value = getattr(self, name)
            if value is not None and not abs(as_float(value)) <= most:  # also True for NaN
                raise InputError("non_finite", f"a joint command has {name} {value}; it must be finite, to {most:g}")
        if self.has_target and self.effort is not None and self.effort < 0.0:
            raise InputError("joint_command", f"effort {self.effort} bounds a target's; it must be zero or more")

    @property
    def has_target(self) -> bool:
        """Return True if the command has a position or velocity to reach."""
        return self.position is not None or self.velocity is not None


@dataclass(frozen=True)
class JointReading:
    """Position [rad or m], velocity [rad/s or m/s], and the effort [Nm or N] that drove the joint in the last step."""

    name: str
    position: float
    velocity: float
    effort: float


def command_joint(client: Any, uid: int, joint: int, command: JointCommand) -> None:
    """Pass a command to PyBullet. An effort must be applied before each step, because PyBullet clears it after it.

    PyBullet ignores the URDF's friction and limit of velocity. Friction is a brake of a joint without target. A drive
    that moves loses it from its effort, and one that stops gains it.
    """
    info = client.getJointInfo(uid, joint)
    friction, limit, fastest = info[7], info[10] or DEFAULT_EFFORT, info[11] or math.inf  # zero = the URDF gives none
    speed = min(max(command.velocity or 0.0, -fastest), fastest)
    stops = command.position is None and not speed
    force = limit if command.effort is None else command.effort
    force = force + friction if stops else force - friction
    if not command.has_target or force <= 0.0:  # a motor that holds; PyBullet enables one in every joint
        held = friction if not command.has_target else -force
        client.setJointMotorControl2(uid, joint, pb.VELOCITY_CONTROL, force=held)
    elif command.position is None:
        client.setJointMotorControl2(uid, joint, pb.VELOCITY_CONTROL, targetVelocity=speed, force=force)
    else:
        most = {} if math.isinf(fastest) else {"maxVelocity": fastest}
        client.setJointMotorControl2(
            uid, joint, pb.POSITION_CONTROL, targetPosition=command.position, targetVelocity=speed, force=force, **most
        )


def read_joints(client: Any, uid: int, joints: dict[str, int], commands: dict[str, JointCommand]) -> list[JointReading]:
    """Return the current readings of a robot's joints, given by name and PyBullet index."""
    readings: list[JointReading] = []
    if not joints:  # PyBullet returns None for an empty list
        return readings
    for (name, _), state in zip(joints.items(), client.getJointStates(uid, list(joints.values())), strict=True):
        command = commands.get(name) or JointCommand()
        # PyBullet reports the effort of its motors only; the value of a disabled motor is stale.
        effort = state[3] if command.has_target else command.effort or 0.0
        readings.append(JointReading(name, state[0], state[1], effort))
    return readings
