"""The robots of the scenes, and the tables of their joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pybullet_data

DATA = Path(pybullet_data.getDataPath())


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot and how it stands.

    ``urdf``: path or text of its description. ``height`` [m]: of the centre of mass of its root link above level ground
    when it stands. ``stance``: joints that are held at a position [rad]. ``wheels``: joints that are braked at rest,
    and driven at ``speed`` [rad/s] otherwise. ``torque`` [Nm]: limit of both. ``reach`` [m]: radius around its middle
    that it stands on.
    """

    name: str
    urdf: str
    height: float
    stance: Mapping[str, float] = field(default_factory=dict)
    wheels: tuple[str, ...] = ()
    speed: float = 0.0
    torque: float = 100.0
    reach: float = 0.4


LEGS = ("FR", "FL", "RR", "RL")


def laikago_joints(leg: str) -> tuple[str, str, str]:
    """Return the names of a leg's joints: abduction, hip, knee."""
    return (
        f"{leg}_hip_motor_2_chassis_joint",
        f"{leg}_upper_leg_2_hip_motor_joint",
        f"{leg}_lower_leg_2_upper_leg_joint",
    )


# Bend of the knees with which laikago's feet stand below its hips [rad].
LAIKAGO_KNEE = -0.5

ROVER = Robot(
    name="rover",
    urdf=str(Path(__file__).with_name("rover.urdf")),
    height=0.12,
    wheels=("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"),
    speed=5.0,
)
HUSKY = Robot(
    name="husky",
    urdf=str(DATA / "husky" / "husky.urdf"),
    height=0.0,
    wheels=("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"),
    speed=5.0,
    reach=0.5,
)
LAIKAGO = Robot(
    name="laikago",
    urdf=str(DATA / "laikago" / "laikago_toes_zup.urdf"),
    height=0.497,
    stance={
        joint: angle for leg in LEGS for joint, angle in zip(laikago_joints(leg), (0.0, 0.0, LAIKAGO_KNEE), strict=True)
    },
)
RACECAR = Robot(
    name="racecar",
    urdf=str(DATA / "racecar" / "racecar.urdf"),
    height=0.0,
    stance={"left_steering_hinge_joint": 0.0, "right_steering_hinge_joint": 0.0},
    # The axles point to the right: positive speeds drive backwards.
    wheels=("left_rear_wheel_joint", "right_rear_wheel_joint", "left_front_wheel_joint", "right_front_wheel_joint"),
    speed=-10.0,
    torque=2.0,
    reach=0.3,
)


# Phase of each leg as a share of the period [-]: the legs of a diagonal swing together.
PHASES = {"FR": 0.0, "RL": 0.0, "FL": 0.5, "RR": 0.5}


# A trot of laikago: period of a step of each leg [s], swing of the hips forwards and backwards [rad], lift of the knees
# while their leg swings forwards [rad], and rate of the table's rows [Hz].
PERIOD, SWING, LIFT, TROT_RATE = 0.4, 0.12, 0.35, 60.0


def trot_at(time: float) -> Mapping[str, float]:
    """Return the joint positions [rad] of the row of a trot's table at a ``time`` [s]. A leg swings forwards in the
    first half of the period, its knee bent, and pushes the ground backwards in the second."""
    rows = round(PERIOD * TROT_RATE)
    share = int(time * TROT_RATE + 1e-6) % rows / rows
    found = {}
    for leg in LEGS:
        angle = 2.0 * math.pi * (share + PHASES[leg])
        abduction, hip, knee = laikago_joints(leg)
        found[abduction] = 0.0
        found[hip] = SWING * math.cos(angle)
        found[knee] = LAIKAGO_KNEE - LIFT * max(math.sin(angle), 0.0)
    return found
