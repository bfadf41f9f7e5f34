"""Wrenches of the ground on simulated bodies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmesh_ros.ground.followers import Follower
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.terrain.grid import FloatArray


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
    before they fell asleep.

    Rolling and spinning friction, which URDFs may ask for, are not included.
    """
    found: list[GroundWrench] = []
    of_colliders: dict[int | None, GroundWrench] = {}
    asleep = ground.contacts_asleep
    for follower in ground.followers:
        if follower.solid:
            centre = np.array(_centre(client, follower))
            wrench = GroundWrench(follower.name, centre, np.zeros(3), np.zeros(3))
            found.append(wrench)
            if follower.collider is not None:
                of_colliders[follower.collider] = wrench
            elif follower.slot in asleep:
                _add(asleep[follower.slot].points, {asleep[follower.slot].collider: wrench})
    _add(client.getContactPoints(), of_colliders)
    return found


def _add(points: Iterable[Any], of_colliders: dict[int | None, GroundWrench]) -> None:
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
