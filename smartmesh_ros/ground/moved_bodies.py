"""Bodies of a PyBullet client that are moved without physics: put back onto the ground, or with its corrections."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.bullet import BulletCalls, is_fixed
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import BoolArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

# Largest horizontal speed that a body keeps that is put back [m/s].
FASTEST_RESCUED = 5.0


def put_back(client: Any, followers: Followers, below: list[tuple[int, float, float]]) -> list[int]:
    """Lift the bodies ``below`` the ground (see `Ground.below`) onto it, robots as a whole; returns their PyBullet
    bodies."""
    lifts: dict[int, tuple[float, float]] = {}
    for slot, lift, rate in below:
        body = followers[slot].body
        if body not in lifts or lift > lifts[body][0]:  # a robot by the largest lift of its links
            lifts[body] = (lift, rate)
    for body, (lift, rate) in lifts.items():
        _lift(client, body, lift, rate)
    return list(lifts)


def _lift(client: Any, body: int, lift: float, rate: float) -> None:
    """Lift a body by ``lift`` [m] and give it the ground's vertical velocity ``rate`` [m/s]."""
    position, orientation = client.getBasePositionAndOrientation(body)
    linear, angular = client.getBaseVelocity(body)
    along = np.array(linear[:2])
    speed = float(np.hypot(*along))
    along *= min(1.0, FASTEST_RESCUED / speed) if speed > 0.0 else 1.0
    client.resetBasePositionAndOrientation(body, (position[0], position[1], position[2] + lift), orientation)
    client.resetBaseVelocity(body, (along[0], along[1], rate), angular)


# A tile that is being corrected: its core's reader, and the instant up to which its corrections were shown before [s].
Correction = tuple[Any, float]


def show_corrections(terrain: Terrain, time: float) -> list[Correction]:
    """Blend corrections of the terrain in up to ``time`` [s]; returns the corrected tiles."""
    moves = []
    for mesh in terrain.tiles.values():
        if isinstance(mesh, HeightMap) and mesh.motion.corrects:
            if mesh.corrections.blending:
                moves.append((mesh.core_reader, mesh.corrections.shown))
            mesh.show(time)
    return moves


def move_with_corrections(
    client: Any, corrections: list[Correction], followers: Followers, standing: BoolArray, time: float
) -> None:
    """Move the bodies of a PyBullet client that stand on tiles that are corrected at ``time`` [s].

    A body that lay on the ground lies on it again, at the same velocity. A robot moves as a whole, by the ground under
    the links that stand on it. ``standing`` (S,): which followers touch the ground.
    """
    solid = followers.solid
    bodies = [followers[slot].body for slot in solid.tolist()]
    uids = list(dict.fromkeys(bodies))
    places = {uid: place for place, uid in enumerate(uids)}
    owners = np.array([places[body] for body in bodies], np.int64)
    poses = BulletCalls(client).poses(uids)
    for place in CORE.move_with_corrections(
        corrections, followers.shape_table.core, followers.states, solid, owners, standing, time, poses
    ):
        _put(client, uids[place], poses[place].tolist())


def _put(client: Any, uid: int, pose: list[float]) -> None:
    if is_fixed(client, uid):
        return
    linear, angular = client.getBaseVelocity(uid)
    client.resetBasePositionAndOrientation(uid, pose[:3], pose[3:])
    client.resetBaseVelocity(uid, linear, angular)
