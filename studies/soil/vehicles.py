"""Boxes and carts on `Soil` in PyBullet, and a wheel whose slip is forced, as in a single-wheel test bed."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, Ground, HeightMap, PhysicsConfig, Soil, SoilType, World, WorldConfig
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.robots.urdf import as_file, joint_of, link_of
from studies.soil.trials import Wheel, WheelForces

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
# Height of the axles below the middle of a cart's chassis [m].
BELOW = 0.05


@dataclass(frozen=True, kw_only=True)
class Cart:
    """A chassis on four driven wheels: all [m] and [kg]."""

    radius: float = 0.1
    width: float = 0.06
    mass: float = 12.0
    wheel_mass: float = 1.0
    base: float = 0.5
    track: float = 0.4

    @property
    def wheel(self) -> Wheel:
        """One of its wheels, with its share of the weight."""
        return Wheel(radius=self.radius, width=self.width, load=0.25 * GRAVITY * self.mass)

    @property
    def urdf(self) -> str:
        """Its description."""
        body, wheel = self.mass - 4.0 * self.wheel_mass, self.wheel_mass
        x, y = self.track**2 * body / 12.0, self.base**2 * body / 12.0
        parts = [link_of("body", body, (x, y, 0.9 * (x + y)))]
        for index, name in enumerate(WHEELS):
            place = f"{(0.5 - index // 2) * self.base} {(0.5 - index % 2) * self.track} {-BELOW}"
            parts.append(_wheel_link(name, wheel, self.radius, self.width))
            parts.append(joint_of(f"{name}_axle", "body", name, "0 1 0", f'<origin xyz="{place}"/>'))
        return f'<robot name="cart">{"".join(parts)}</robot>'


# About a Clearpath Warthog.
WARTHOG = Cart(radius=0.3, width=0.22, mass=268.0, wheel_mass=20.0, base=0.9, track=1.1)


def _wheel_link(name: str, mass: float, radius: float, width: float) -> str:
    """Return a wheel that turns about y: a cylinder of a ``mass`` [kg], a ``radius`` and a ``width`` [m]."""
    along, across = 0.5 * mass * radius**2, mass * (radius**2 / 4.0 + width**2 / 12.0)
    shape = f'<geometry><cylinder radius="{radius}" length="{width}"/></geometry>'
    turned = f'<collision><origin xyz="0 0 0" rpy="{0.5 * math.pi} 0 0"/>{shape}</collision>'
    return link_of(name, mass, (across, along, across), turned)


class Drive(NamedTuple):
    """How a cart drove: its ``slip``; share of the steps in which a wheel was ``unloaded``; ``worst`` force on a wheel
    over its share of the weight."""

    slip: float
    unloaded: float
    worst: float


def drive(
    cart: Cart, soil: SoilType | str, *, speed: float = 0.3, seconds: float = 6.0, grid: float = 0.02,
    heading: float = 0.0,
) -> Drive:  # fmt: skip
    """Drive a cart straight ahead with rims that turn at a ``speed`` [m/s]; the second half of the time counts.
    ``heading`` [rad]: from the map's columns."""
    side, ahead = round((speed * seconds + 3.0 * cart.base) / grid) + 20, (math.cos(heading), math.sin(heading))
    with World(HeightMap(np.zeros((side, side)), resolution=grid)) as world:
        x, y = 0.503 * grid * (side - 1) - 0.5 * speed * seconds * np.array(ahead)
        turn = (0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))
        world.spawn_robot("cart", cart.urdf, BodyState((x, y, cart.radius + BELOW), turn))
        world.ground.set_soil(Soil(world.terrain, soil, spacing=0.01))
        steps = round(seconds / world.dt)
        forces, ways = [], []
        for step in range(steps):
            share = min(max(2.0 * step * world.dt - 1.0, 0.0), 1.0)  # stands, then starts gently
            for name in WHEELS:
                world.drive("cart", f"{name}_axle", share * speed / cart.radius, 20.0 * GRAVITY * cart.mass)
            world.step()
            ways.append(np.dot(world.state("cart").position[:2], ahead))
            if step >= steps // 2:
                forces.append(dict.fromkeys((f"cart/{name}" for name in WHEELS), 0.0))
                for contact in world.contacts():
                    if contact.body in forces[-1]:
                        forces[-1][contact.body] += contact.normal_force * contact.normal[2]
    counted, vertical = len(forces) - 1, np.array([list(found.values()) for found in forces])
    return Drive(
        1.0 - (ways[-1] - ways[-1 - counted]) / (counted * world.dt) / speed,
        float(np.mean(vertical <= 0.0)),
        float(np.max(vertical)) / cart.wheel.load,
    )


class SetDown(NamedTuple):
    """A body that was set down: its top ``speed`` [m/s] in the last second, and how much the kinetic and potential
    energy of all its links ever ``rose`` [m of height]."""

    speed: float
    rose: float


def set_down(number: int, soil: str, *, rate: float = 240.0) -> SetDown:
    """Set one of several kinds of body down on rough or smooth slopes, flat or anyhow; it is left alone for 3 s.
    ``rate`` [Hz]: of physics."""
    random = np.random.default_rng(number)
    slope = math.tan(math.radians(random.uniform(0.0, 12.0)))
    heights = np.tile(-slope * 0.05 * np.arange(161), (81, 1)) + (number % 2) * random.normal(0.0, 0.01, (81, 161))
    shapes: list[Shape] = [Box(0.3, 0.2, 0.15), Sphere(0.12), Cylinder(radius=0.12, height=0.1)]
    config = WorldConfig(physics=PhysicsConfig(rate=rate))
    with World(HeightMap(heights, resolution=0.05), config) as world:
        world.ground.set_soil(Soil(world.terrain, soil))
        kind, flat = number // 2 % 4, number // 8 % 2 == 0
        x, y = 2.0 + random.uniform(-0.1, 0.1, 2)
        turn = random.normal(size=4)
        pose = BodyState((x, y, 0.0), (0.0, 0.0, 0.0, 1.0) if flat else tuple(turn / np.linalg.norm(turn)))
        if kind < 3:
            world.spawn("body", shapes[kind], random.uniform(2.0, 60.0), pose, on_ground=True, align=flat)
        else:
            world.spawn_robot("body", Cart().urdf, BodyState((x, y, 0.0)), on_ground=True, align=True)
            for name in WHEELS:
                world.drive("body", f"{name}_axle", 0.0, 100.0)
        speeds, energies, client, uid = [], [], world.client, world.bodies["body"].uid
        for _ in range(round(3.0 * rate)):
            world.step()
            speeds.append(math.hypot(*client.getBaseVelocity(uid)[0]))
            energies.append(_energy(client, uid, world.dt))
        rose = float(np.max(np.array(energies) - np.minimum.accumulate(energies)))
    return SetDown(max(speeds[round(2.0 * rate) :]), rose)


def _energy(client: Any, body: int, dt: float) -> float:
    """Return the kinetic and potential energy of a body and its links over its weight [m]. In free fall, PyBullet's
    steps of ``dt`` [s] conserve it."""
    total = weight = 0.0
    for link in range(-1, client.getNumJoints(body)):
        mass, _, inertia = client.getDynamicsInfo(body, link)[:3]
        if link < 0:
            place, turn = client.getBasePositionAndOrientation(body)
            linear, angular = client.getBaseVelocity(body)
        else:
            found = client.getLinkState(body, link, computeLinkVelocity=1, computeForwardKinematics=1)
            place, turn, linear, angular = found[0], found[1], found[6], found[7]
        axes = np.reshape(client.getMatrixFromQuaternion(turn), (3, 3))
        spun = np.array(inertia) @ (axes.T @ np.array(angular)) ** 2
        moving = 0.5 * (mass * np.dot(linear, linear) + spun) / GRAVITY
        total += mass * (place[2] + 0.5 * linear[2] * dt) + moving
        weight += mass
    return float(total / weight)


DT = 1.0 / 240.0
STRONG = 1e4  # force of motors [N], [N m]


def _rig_urdf(wheel: Wheel) -> str:
    mass, light = wheel.load / GRAVITY, (0.01, 0.01, 0.01)
    rim = 0.25 * mass
    parts = [link_of("base", 1.0, light), link_of("carriage", 1.0, light), link_of("hub", mass - rim, light)]
    parts.append(_wheel_link("wheel", rim, wheel.radius, wheel.width))
    limit = '<limit lower="-10" upper="10" effort="1e5" velocity="10"/>'
    parts.append(joint_of("slide", "base", "carriage", "1 0 0", limit, "prismatic"))
    parts.append(joint_of("lift", "carriage", "hub", "0 0 1", limit, "prismatic"))
    parts.append(joint_of("axle", "hub", "wheel", "0 1 0"))
    return f'<robot name="rig">{"".join(parts)}</robot>'


def roll(
    wheel: Wheel, soil: SoilType | str, slip: float, *, speed: float = 0.02, slip_sinkage: bool = True,
    implicit: bool = True,
) -> WheelForces:  # fmt: skip
    """Roll a wheel over flat ground on a way of 0.2 m at a ``speed`` [m/s] and a ``slip``; the second half of the way
    counts. ``implicit``: PyBullet collides a cylinder, else the hull of its mesh."""
    client = BulletClient(pb.DIRECT)
    client.setGravity(0.0, 0.0, -GRAVITY)
    client.setTimeStep(DT)
    grid, way = 0.01, 0.2
    shape = (round((wheel.width + 0.12) / grid) + 1, round((way + 0.4 + 4.0 * wheel.radius) / grid) + 1)
    ground = Ground(client, HeightMap(np.zeros(shape), resolution=grid))
    with as_file(_rig_urdf(wheel)) as path:
        place = (0.1 + 2.0 * wheel.radius, 0.5 * grid * (shape[0] - 1), wheel.radius)
        flags = pb.URDF_USE_INERTIA_FROM_FILE | (pb.URDF_USE_IMPLICIT_CYLINDER if implicit else 0)
        rig = client.loadURDF(path, place, useFixedBase=True, flags=flags)
    slide, lift, axle = range(3)
    for joint in (slide, lift, axle):
        client.setJointMotorControl2(rig, joint, pb.VELOCITY_CONTROL, force=0.0)
    ground.attach(rig, axle)
    ground.set_soil(Soil(ground.terrain, soil, spacing=0.005, slip_sinkage=slip_sinkage))
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
