"""Moves bodies with corrections of the ground under them: sets their poses and keeps their velocities.

A body that lay on the ground lies on it again, at the same velocity. A robot moves as a whole, by the ground under the
links that stand on it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.ground.bullet_sleep import is_fixed
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain


class Correction(NamedTuple):
    """A tile that is being corrected: its ``number``, its map, and the instant up to which its corrections were shown
    ``before`` [s]."""

    number: int
    heightmap: HeightMap
    before: float


def correcting(mesh: MainMesh) -> bool:
    """Return True while corrections of a tile are being blended in."""
    return isinstance(mesh, HeightMap) and mesh.correcting


def show_corrections(terrain: Terrain, time: float) -> list[Correction]:
    """Blend corrections of the terrain in up to ``time`` [s]; returns the corrected tiles."""
    moves = []
    for name, mesh in terrain.tiles.items():
        if isinstance(mesh, HeightMap) and mesh.motion.corrects:
            blending, before = mesh.correcting, mesh.shown
            mesh.show(time)
            if blending:
                moves.append(Correction(terrain.numbers[name], mesh, before))
    return moves


def move_with_corrections(
    client: Any, corrections: list[Correction], followers: Followers, supports: Any, time: float
) -> None:
    """Move the bodies of a PyBullet client that stand on tiles that are corrected at ``time`` [s]."""
    solid = followers.solid
    bodies = [followers[slot].body for slot in solid.tolist()]
    uids = list(dict.fromkeys(bodies))
    places = {uid: place for place, uid in enumerate(uids)}
    owners = np.array([places[body] for body in bodies], np.int64)
    poses = np.array([_pose(client, uid) for uid in uids]).reshape(-1, 7)
    tiles = [(number, heightmap.core_reader, before) for number, heightmap, before in corrections]
    for place in CORE.move_with_corrections(
        tiles, followers.shape_table.core, followers.states, solid, owners, as_bytes(supports), time, poses
    ):
        _put(client, uids[place], poses[place].tolist())


def _pose(client: Any, uid: int) -> tuple[float, ...]:
    position, turn = client.getBasePositionAndOrientation(uid)
    return (*position, *turn)


def _put(client: Any, uid: int, pose: list[float]) -> None:
    if is_fixed(client, uid):
        return
    linear, angular = client.getBaseVelocity(uid)
    client.resetBasePositionAndOrientation(uid, pose[:3], pose[3:])
    client.resetBaseVelocity(uid, linear, angular)
