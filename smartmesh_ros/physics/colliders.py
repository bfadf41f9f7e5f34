"""The colliders of followers, of whatever kind: a follower has one at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.heightfields import Heightfields
from smartmesh_ros.physics.mesh_colliders import MeshColliders
from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.physics.planes import Planes
from smartmesh_ros.terrain.grid import BoolArray, IntArray

# What a follower has.
NOTHING, FIELD, PLANE, MESH = range(4)


class Colliders:
    """Heightfields, planes and meshes, and who has which, by the follower's index."""

    def __init__(self, client: Any) -> None:
        pairs = Pairs(client)
        self.fields = Heightfields(client, pairs)
        self.planes = Planes(client, pairs)
        self.meshes = MeshColliders(client, pairs)
        self._followers: list[Follower] = []
        self._held = np.empty(0, np.int64)
        self._away = np.empty(0, bool)  # whose collider waits far away

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept``: each one's index before, -1 = new."""
        carry_over(self, {"_held": NOTHING, "_away": False}, kept)
        self._followers = followers
        self.fields.adopt(followers, kept)
        self.planes.adopt(followers, kept)

    def stand_still(self, duration: float) -> None:
        """Says that for a ``duration`` [s] time went on and colliders did not."""
        self.fields.stand_still(duration)
        self.planes.stand_still(duration)

    def make_room(self, followers: IntArray, kind: int) -> None:
        """Takes colliders from followers (n,) that have another kind than the one they are to be given now."""
        for index in followers[self._held[followers] != kind].tolist():
            self.release(index)
            self._held[index] = kind
        self._away[followers] = False

    def put_away(self, needed: BoolArray) -> None:
        """Takes colliders from followers that need none now (N,); the usual ones wait for when they do again."""
        indices = np.flatnonzero(~needed & (self._held != NOTHING) & ~self._away)
        self._away[indices] = True
        held = self._held[indices]
        self.fields.put_away(indices[held == FIELD])
        self.planes.put_away(indices[held == PLANE])
        for index in indices[held == MESH].tolist():
            self.release(index)

    def release(self, index: int) -> None:
        """Takes a follower's collider away, if it has one."""
        self.fields.release(index)
        self.planes.release(index)
        self.meshes.release(self._followers[index])
        self._held[index] = NOTHING
