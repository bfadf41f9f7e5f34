"""Contacts between bodies and the ground, and the wrenches of the ground on bodies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.followers import Follower
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.patches.shapes import BodyShape, ShapeKind
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


def ground_contacts(client: Any, ground: Ground, time: float) -> list[GroundContact]:
    """Return the contacts with the ground in the last step; for tracked bodies, those with the ground at ``time``
    [s]."""
    followers = ground.followers
    colliders = {follower.collider: follower.name for follower in followers if follower.collider is not None}
    contacts = contacts_from(client.getContactPoints(), colliders)
    tracked = followers.tracked
    if tracked.size:
        states = ground.contacts.states_of(tracked)
        found = (
            _contact_of_tracked(followers[slot], ground, state, time)
            for slot, state in zip(tracked.tolist(), states, strict=True)
        )
        contacts += [contact for contact in found if contact is not None]
    return contacts


def contacts_from(points: Iterable[Any], colliders: dict[int, str]) -> list[GroundContact]:
    """Return the contacts with the ``colliders``, which map PyBullet bodies to the names of their followers, among
    PyBullet's contact ``points``. Points that neither touch nor hold, of what comes near in the step, do not count."""
    contacts = []
    for point in points:
        if point[8] > 0.0 and point[9] == 0.0:
            continue
        first, second = colliders.get(point[1]), colliders.get(point[2])
        if second is not None:  # PyBullet's normal points from the second body to the first
            contacts.append(GroundContact(second, point[6], point[7], -point[8], point[9]))
        elif first is not None:
            x, y, z = point[7]
            contacts.append(GroundContact(first, point[5], (-x, -y, -z), -point[8], point[9]))
    return contacts


def _contact_of_tracked(follower: Follower, ground: Ground, state: FloatArray, time: float) -> GroundContact | None:
    """Return the deepest contact of a tracked body at a ``state`` (13,), None if there is none."""
    deepest = None
    for part, position, orientation in _parts_at(follower.shape, state[:3].tolist(), state[3:7].tolist()):
        pose = np.vstack([np.reshape(pb.getMatrixFromQuaternion(orientation), (3, 3)), position])
        tiles = ground.terrain.readers_for(follower.body)
        found = CORE.find_contacts(_core_shape(part), tiles, pose, np.zeros((2, 3)), 0.0, 0.0, time)
        for contact in found:
            if deepest is None or contact[6] < deepest[6]:
                deepest = contact
    if deepest is None or deepest[6] > 0.0:
        return None
    x, y, z, east, north, up, distance = deepest[:7].tolist()
    return GroundContact(follower.name, (x, y, z), (east, north, up), -distance, float("nan"))


def _parts_at(shape: BodyShape, position: Any, orientation: Any) -> Iterator[tuple[BodyShape, Any, Any]]:
    """Yield the convex parts of a shape with their positions [m] and orientations (x, y, z, w)."""
    record = shape.record
    at, turn = pb.multiplyTransforms(position, orientation, record["offset"].tolist(), record["turn"].tolist())
    if not shape.parts:
        yield shape, at, turn
    for part in shape.parts:
        yield from _parts_at(part, at, turn)


def _core_shape(part: BodyShape) -> Any:
    """Return a convex part as the core's contacts take it."""
    (x, y, z), rounding = part.record["half"].tolist(), float(part.record["rounding"])
    match part.kind:
        case ShapeKind.BALL:
            return CORE.Shape.ball(rounding)
        case ShapeKind.CAPSULE:
            return CORE.Shape.capsule(rounding, z)
        case ShapeKind.CYLINDER:
            return CORE.Shape.cylinder(x, z)
        case ShapeKind.BOX:
            return CORE.Shape.box(x, y, z)
    return CORE.Shape.hull(part.vertices, rounding)


@dataclass(frozen=True)
class GroundWrench:
    """Force [N], and torque [Nm] about the centre of mass [m], of the ground on a body or link; all (3,) in the
    terrain's frame."""

    body: str
    centre: FloatArray
    force: FloatArray
    torque: FloatArray


def wrenches_of_step(client: Any, ground: Ground) -> list[GroundWrench]:
    """Return the wrenches of the last step on the simulated bodies of a ``ground``; for sleeping bodies, of the step
    before they fell asleep, whose contacts PyBullet keeps.

    Rolling and spinning friction, which URDFs may ask for, are not included.
    """
    found: list[GroundWrench] = []
    of_colliders: dict[int, GroundWrench] = {}
    for follower in ground.followers:
        if follower.solid:
            centre = np.array(_centre(client, follower))
            wrench = GroundWrench(follower.name, centre, np.zeros(3), np.zeros(3))
            found.append(wrench)
            if follower.collider is not None:
                of_colliders[follower.collider] = wrench
    _add(client.getContactPoints(), of_colliders)
    return found


def _add(points: Iterable[Any], of_colliders: dict[int, GroundWrench]) -> None:
    """Add the forces of PyBullet's contact ``points`` with colliders to the wrenches on their followers."""
    for point in points:
        # PyBullet reports the forces on the first of the two bodies.
        if (wrench := of_colliders.get(point[2])) is not None:
            sign, position = 1.0, point[5]
        elif (wrench := of_colliders.get(point[1])) is not None:
            sign, position = -1.0, point[6]
        else:
            continue
        force = sign * (np.array([point[9], point[10], point[12]]) @ np.array([point[7], point[11], point[13]]))
        wrench.force[:] += force
        wrench.torque[:] += np.cross(np.array(position) - wrench.centre, force)


def _centre(client: Any, follower: Follower) -> tuple[float, float, float]:
    if follower.link < 0:
        position = client.getBasePositionAndOrientation(follower.body)[0]
    else:
        position = client.getLinkState(follower.body, follower.link)[0]
    x, y, z = position
    return x, y, z
