"""Wrenches of the ground on simulated bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmesh_ros.physics.followers import Follower, Followers
from smartmesh_ros.terrain.grid import FloatArray


@dataclass(frozen=True)
class GroundWrench:
    """Force [N], and torque [Nm] about the centre of mass [m], of the ground on a body or link; all (3,) in the
    terrain's frame."""

    body: str
    centre: FloatArray
    force: FloatArray
    torque: FloatArray


def wrenches_of_step(client: Any, followers: Followers) -> list[GroundWrench]:
    """Return the wrenches of the last step on the simulated bodies among ``followers``.

    Rolling and spinning friction, which URDFs may ask for, are not included.
    """
    found: dict[str, GroundWrench] = {}
    of_colliders: dict[int, GroundWrench] = {}
    for follower in followers:
        if follower.solid:
            name = follower.name
            centre = np.array(_centre(client, follower))
            found[name] = GroundWrench(name, centre, np.zeros(3), np.zeros(3))
            if follower.collider is not None:
                of_colliders[follower.collider] = found[name]
    for point in client.getContactPoints():
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
    return list(found.values())


def _centre(client: Any, follower: Follower) -> tuple[float, float, float]:
    if follower.link < 0:
        position = client.getBasePositionAndOrientation(follower.body)[0]
    else:
        position = client.getLinkState(follower.body, follower.link)[0]
    x, y, z = position
    return x, y, z
