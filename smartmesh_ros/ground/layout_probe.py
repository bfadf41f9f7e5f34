"""Checks that the core was compiled for the PyBullet that runs: values that one of them sets must be those that the
other reads in Bullet's memory. The check uses a client of its own, so that no world of a user changes."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.ground.bullet import BulletCalls, own_client
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

# What the names of the plugin's functions end with.
POSTFIX = "_smartmesh"
# Pose and velocities of the bodies that are read: [m], quaternion (x, y, z, w), [m/s], [rad/s].
POSE = ((1.0, -2.0, 3.0), (0.6, 0.0, 0.0, 0.8))
VELOCITY = ((0.1, 0.2, -0.3), (-0.4, 0.5, 0.6))
# Settings of the solver that PyBullet is given: gravity [m/s^2], time step [s], erp, friction erp, slop [m].
SETTINGS = (0.3, -0.2, -9.5, 1.0 / 250.0, 0.11, 0.13, 3e-5)
# PyBullet's state of a body that sleeps, and the steps until a multibody does.
STOPPED, STEPS_TO_STOP = pb.ACTIVATION_STATE_ENABLE_SLEEPING | pb.ACTIVATION_STATE_SLEEP, 2
# Balls that touch the ground [m], and their coefficients.
RADIUS, DEPTH, FRICTION, RESTITUTION = 0.1, 1e-4, 0.4, 0.5
SHAPE = BodyShape.ball(RADIUS)


def number_of(client: Any) -> int:
    """Load the core into the server of a client; returns the number of its world for the core, -1 if it cannot be
    loaded."""
    plugin = client.loadPlugin(CORE.__file__, POSTFIX)
    return -1 if plugin < 0 else int(client.executePluginCommand(plugin, "number", []))


@cache
def misread() -> str:
    """Return what the core finds or leaves elsewhere in Bullet's memory than PyBullet, empty if nothing."""
    with own_client() as client:
        number = number_of(client)
        if number < 0:
            return "the world"
        core = CORE.Ground(number)
        for name, agrees in CHECKS.items():
            try:
                if not agrees(client, core):
                    return name
            except ValueError:  # the core does not find a body
                return name
        return ""


def _reads_bodies(client: Any, core: Any) -> bool:
    """Read a multibody, a rigid body, and a robot's link that turns."""
    ball = client.createCollisionShape(pb.GEOM_SPHERE, radius=RADIUS)
    bodies = [client.createMultiBody(1.0, ball, -1, *POSE, useMaximalCoordinates=rigid) for rigid in (0, 1)]
    arm = client.createMultiBody(
        1.0, ball, -1, *POSE, linkMasses=[0.5], linkCollisionShapeIndices=[ball], linkVisualShapeIndices=[-1],
        linkPositions=[(0.1, 0.2, 0.3)], linkOrientations=[POSE[1]], linkInertialFramePositions=[(0.0, 0.0, 0.0)],
        linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)], linkParentIndices=[0],
        linkJointTypes=[pb.JOINT_REVOLUTE], linkJointAxis=[(0.0, 0.6, 0.8)],
    )  # fmt: skip
    client.resetJointState(arm, 0, 0.7, 1.3)
    told = np.empty((3, 13))
    for slot, (body, link) in enumerate([(bodies[0], -1), (bodies[1], -1), (arm, 0)]):
        client.resetBaseVelocity(body, *VELOCITY)
        core.attach(slot, body, link, -1, SHAPE)
        told[slot] = BulletCalls(client).state(body, link)
    return _same(core.read(np.arange(3)), told)


def _reads_settings(client: Any, core: Any) -> bool:
    """Tell PyBullet the settings of its solver, and read them after a step."""
    client.setGravity(*SETTINGS[:3])
    names = ("fixedTimeStep", "contactERP", "frictionERP", "contactSlop")
    client.setPhysicsEngineParameter(**dict(zip(names, SETTINGS[3:], strict=True)))
    client.stepSimulation()
    return _same(CORE.solver_settings(core.number), SETTINGS)


def _writes_contacts(client: Any, core: Any) -> bool:
    """Let a ball slide over its proxy in a step, and another one bounce: PyBullet reports the point that was written,
    the core reads PyBullet's impulses, and the solver has taken friction, restitution and the share of the penetration
    that it corrects from the point."""
    ground = HeightMap(np.zeros((5, 5)), resolution=1.0, origin=(-2.0, -2.0))
    core.set_tiles(Terrain(ground).core)
    slides = _drop(client, core, 3, (0.2, -0.1, RADIUS - DEPTH), (1.0, 0.0, 0.0))
    bounces = _drop(client, core, 4, (-0.9, 0.7, RADIUS - DEPTH), (0.0, 0.0, -2.0))
    client.stepSimulation()
    points, written, dt = client.getContactPoints(slides), CORE.contacts_of(core.number, 3), SETTINGS[3]
    if len(points) != 1 or len(written) != 1:
        return False
    _, _, _, _, _, _, on_ground, normal, distance, force, along, way, across, other_way = points[0]
    friction = along * np.array(way) + across * np.array(other_way)
    rises, rebounds = (client.getBaseVelocity(body)[0][2] for body in (slides, bounces))
    return (
        _same((*on_ground, *normal, distance), (0.2, -0.1, 0.0, 0.0, 0.0, 1.0, -DEPTH))
        and _same(written[0], (0.2, -0.1, 0.0, force * dt, *(friction * dt)))
        and force > 0.0
        and _same(math.hypot(along, across), FRICTION * force)
        and 0.0 <= rises <= DEPTH / dt
        and abs(rebounds - RESTITUTION * 2.0) < 0.1
    )


def _filters_pairs(client: Any, core: Any) -> bool:
    """Let a ball lie in another one that nothing touches, and rays meet it."""
    ball = client.createCollisionShape(pb.GEOM_SPHERE, radius=RADIUS)
    lies = client.createMultiBody(1.0, ball, -1, (9.0, -3.0, 0.0))
    untouched = client.createMultiBody(
        0.0, client.createCollisionShape(pb.GEOM_SPHERE, radius=0.5), -1, (9.0, -3.0, 0.0)
    )
    core.keep_apart(untouched)
    client.stepSimulation()
    (met,) = client.rayTest((9.0, -3.0, 1.0), (9.0, -3.0, -1.0))
    return not client.getContactPoints(lies) and met[0] == untouched


def _wakes_bodies(client: Any, core: Any) -> bool:
    """Stop a multibody and a rigid body, and wake them: they fall."""
    ball = client.createCollisionShape(pb.GEOM_SPHERE, radius=RADIUS)
    bodies = [client.createMultiBody(1.0, ball, -1, (9.0, rigid, 0.0), useMaximalCoordinates=rigid) for rigid in (0, 1)]
    for slot, body in enumerate(bodies, 5):
        client.changeDynamics(body, -1, activationState=STOPPED)
        core.attach(slot, body, -1, -1, SHAPE)
    speeds = []
    for _ in range(STEPS_TO_STOP + 1):
        client.stepSimulation()
        speeds.append([client.getBaseVelocity(body)[0][2] for body in bodies])
        if len(speeds) == STEPS_TO_STOP:
            core.wake_all()
    return _same(speeds[-2], 0.0) and bool(np.all(np.array(speeds[-1]) < 0.0))


CHECKS: dict[str, Callable[[Any, Any], bool]] = {
    "the states of bodies and links": _reads_bodies,
    "the settings of the solver": _reads_settings,
    "contacts": _writes_contacts,
    "pairs of bodies": _filters_pairs,
    "sleep": _wakes_bodies,
}


def _drop(client: Any, core: Any, slot: int, at: tuple[float, ...], velocity: tuple[float, ...]) -> int:
    """Put a ball with a velocity on a proxy of its own; returns its PyBullet body."""
    ball, point = (client.createCollisionShape(pb.GEOM_SPHERE, radius=radius) for radius in (RADIUS, 1e-3))
    body = int(client.createMultiBody(1.0, ball, -1, at))
    proxy = client.createMultiBody(0.0, point, useMaximalCoordinates=1)
    client.changeDynamics(body, -1, lateralFriction=FRICTION, restitution=RESTITUTION)
    client.changeDynamics(proxy, -1, lateralFriction=1.0, restitution=1.0)
    client.resetBaseVelocity(body, velocity, (0.0, 0.0, 0.0))
    core.attach(slot, body, -1, proxy, SHAPE)
    return body


def _same(found: ArrayLike, told: ArrayLike) -> bool:
    return np.allclose(found, told, rtol=0.0, atol=1e-9)
