"""A wheel whose slip is forced, as in a single-wheel test bed, on `ContactSoil`."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.soil.config import SoilType
from smartmesh_ros.soil.contact_soil import ContactSoil
from smartmesh_ros.terrain.heightmap import HeightMap
from studies.soil.arcs import WheelForces
from studies.soil.trials import Wheel
from studies.soil.vehicles import GRAVITY, link_of

DT = 1.0 / 240.0
STRONG = 1e4  # force of motors [N], [N m]


def _urdf(wheel: Wheel) -> str:
    mass = wheel.load / GRAVITY
    rim = 0.25 * mass
    along, across = 0.5 * rim * wheel.radius**2, rim * (wheel.radius**2 / 4.0 + wheel.width**2 / 12.0)
    shape = (
        f'<collision><origin xyz="0 0 0" rpy="{0.5 * math.pi} 0 0"/><geometry><cylinder radius="{wheel.radius}" '
        f'length="{wheel.width}"/></geometry></collision>'
    )
    light = (0.01, 0.01, 0.01)
    parts = [link_of("base", 1.0, light), link_of("carriage", 1.0, light), link_of("hub", mass - rim, light)]
    parts.append(link_of("wheel", rim, (across, along, across), shape))
    for name, kind, parent, child, axis in (
        ("slide", "prismatic", "base", "carriage", "1 0 0"), ("lift", "prismatic", "carriage", "hub", "0 0 1"),
        ("axle", "continuous", "hub", "wheel", "0 1 0"),
    ):  # fmt: skip
        limit = '<limit lower="-10" upper="10" effort="1e5" velocity="10"/>' if kind == "prismatic" else ""
        parts.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
            f"{limit}</joint>"
        )
    return f'<robot name="rig">{"".join(parts)}</robot>'


def roll(
    wheel: Wheel,
    soil: SoilType | str,
    slip: float,
    *,
    speed: float = 0.02,
    way: float = 0.2,
    spacing: float = 0.005,
    slip_sinkage: bool = True,
    implicit: bool = True,
) -> WheelForces:
    """Roll a wheel over flat ground on a ``way`` [m] at a ``speed`` [m/s] and a ``slip``; the second half of the way
    counts. ``implicit``: PyBullet collides a cylinder, else the hull of its mesh."""
    client = BulletClient(pb.DIRECT)
    client.setGravity(0.0, 0.0, -GRAVITY)
    client.setTimeStep(DT)
    grid = 0.01
    shape = (round((wheel.width + 0.12) / grid) + 1, round((way + 0.4 + 4.0 * wheel.radius) / grid) + 1)
    ground = Ground(client, HeightMap(np.zeros(shape), resolution=grid))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.urdf"
        file.write_text(_urdf(wheel))
        place = (0.1 + 2.0 * wheel.radius, 0.5 * grid * (shape[0] - 1), wheel.radius)
        flags = pb.URDF_USE_INERTIA_FROM_FILE | (pb.URDF_USE_IMPLICIT_CYLINDER if implicit else 0)
        rig = client.loadURDF(str(file), place, useFixedBase=True, flags=flags)
    slide, lift, axle = range(3)
    for joint in (slide, lift, axle):
        client.setJointMotorControl2(rig, joint, pb.VELOCITY_CONTROL, force=0.0)
    ground.attach(rig, axle)
    ground.set_soil(ContactSoil(ground.terrain, soil, spacing=spacing, slip_sinkage=slip_sinkage))
    stand, steps = 120, round(way / speed / DT)
    sinkages, pulls = [], []
    for step in range(stand + steps):
        if step >= stand:
            now = speed * min((step - stand) / 48, 1.0)
            client.setJointMotorControl2(rig, slide, pb.VELOCITY_CONTROL, targetVelocity=now, force=STRONG)
            turn = now / (1.0 - slip) / wheel.radius
            client.setJointMotorControl2(rig, axle, pb.VELOCITY_CONTROL, targetVelocity=turn, force=STRONG)
        ground.step(step * DT, DT)
        if step >= stand + steps // 2:
            sinkages.append(-client.getJointState(rig, lift)[0])
            pulls.append(-client.getJointState(rig, slide)[3])
    client.disconnect()
    return WheelForces(float(np.mean(sinkages)), float(np.mean(pulls)))
