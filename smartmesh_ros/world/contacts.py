"""Contacts between bodies and the ground, and the wrenches of the ground on bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.terrain.grid import FloatArray


@dataclass(frozen=True)
class GroundContact:
    """A contact of a body, or a robot's link, with the ground.

    ``position``: on the ground's surface [m]. ``normal``: unit, from the ground into the body. ``depth`` [m]: positive
    if they overlap. ``normal_force`` [N]: NaN for tracked bodies.
    """

    body: str
    position: tuple[float, float, float]
    normal: tuple[float, float, float]
    depth: float
    normal_force: float


def ground_contacts(client: Any, ground: Ground) -> list[GroundContact]:
    """Return the contacts with the ground in the last step, but of remote bodies; for tracked bodies, those with the
    ground now."""
    own = [follower for follower in ground.followers if not follower.remote]
    colliders = {follower.collider: follower.name for follower in own if follower.collider is not None}
    contacts = []
    for point in client.getContactPoints():
        if point[8] > 0.0 and point[9] == 0.0:  # came near in the step, and neither touches nor holds
            continue
        first, second = colliders.get(point[1]), colliders.get(point[2])
        if second is not None:  # PyBullet's normal points from the second body to the first
            contacts.append(GroundContact(second, point[6], point[7], -point[8], point[9]))
        elif first is not None:
            x, y, z = point[7]
            contacts.append(GroundContact(first, point[5], (-x, -y, -z), -point[8], point[9]))
    for follower in own:
        if not follower.solid and (found := ground.contacts.core.deepest_contact(follower.slot)):
            position, normal, depth = found
            contacts.append(GroundContact(follower.name, position, normal, depth, math.nan))
    return contacts


@dataclass(frozen=True)
class GroundWrench:
    """Force [N], and torque [Nm] about the centre of mass, of the ground on a body or link in a step. ``centre``
    [m]: of mass, after the step. All (3,) are in the terrain's frame."""

    body: str
    centre: FloatArray
    force: FloatArray
    torque: FloatArray


def wrenches_of_step(client: Any, ground: Ground, dt: float) -> list[GroundWrench]:
    """Return the wrenches of the last step, of ``dt`` [s], on the bodies that this world simulates; for sleeping
    bodies, of the step before they fell asleep, whose contacts PyBullet keeps.

    Rolling and spinning friction, which URDFs may ask for, are not included.
    """
    found: list[GroundWrench] = []
    of_colliders: dict[int, tuple[GroundWrench, FloatArray]] = {}  # and the centre where the contacts are
    calls = BulletCalls(client)
    for follower in ground.followers:
        if follower.solid and not follower.remote:
            state = calls.state(follower.body, follower.link)
            wrench = GroundWrench(follower.name, state[:3], np.zeros(3), np.zeros(3))
            found.append(wrench)
            if follower.collider is not None:  # contacts are where they were before the step
                of_colliders[follower.collider] = wrench, state[:3] - dt * state[7:10]
    for point in client.getContactPoints():
        # PyBullet reports the forces on the first of the two bodies.
        first, second = of_colliders.get(point[2]), of_colliders.get(point[1])
        touched, sign, position = (first, 1.0, point[5]) if first is not None else (second, -1.0, point[6])
        if touched is None:
            continue
        wrench, centre = touched
        force = sign * (np.array([point[9], point[10], point[12]]) @ np.array([point[7], point[11], point[13]]))
        wrench.force[:] += force
        wrench.torque[:] += np.cross(np.array(position) - centre, force)
    return found
