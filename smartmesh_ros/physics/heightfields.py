"""Colliders of many followers as heightfields replaced in place: only what changed touches PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import GridBatch
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.heightfield import BOUND, Heightfield, HeightfieldPool, collider_order, collider_yaw
from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Heights that differ by less than this from the collider's are not worth replacing it [m].
SAME_HEIGHT = 1e-6
# PyBullet keeps the contacts of a heightfield that is replaced: a body stays up where the ground sank away under it.
# They are dropped when any sample has sunk by more than this, seen from the collider's base [m].
STALE = 5e-4

_FILLS = {
    "_sizes": 0,
    "_spacings": 0.0,
    "_shapes": -1,
    "_colliders": -1,
    "_heights": np.nan,
    "_contact_heights": np.nan,
    "_poses": np.nan,
    "_twists": 0.0,
}


class Heightfields:
    """The heightfields under followers, by the follower's index."""

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self.replacements = 0
        self._calls = BulletCalls(client)
        self._pool = HeightfieldPool(client, pairs)
        self._followers: list[Follower] = []
        self._fields: dict[Follower, Heightfield] = {}
        # The followers' colliders, size 0 = none: samples on a side, their distance [m], shape and body.
        self._sizes = np.empty(0, np.int64)
        self._spacings = np.empty(0)
        self._shapes = np.empty(0, np.int64)
        self._colliders = np.empty(0, np.int64)
        # What the colliders were last given: heights [m], base position [m] and yaw [rad], twist [m/s, rad/s].
        # Heights when PyBullet last forgot their contacts.
        self._contact_heights = np.empty((0, 81))
        self._heights = np.empty((0, 81))
        self._poses = np.empty((0, 4))
        self._twists = np.empty((0, 6))

    @property
    def created(self) -> int:
        """Heightfields made so far."""
        return self._pool.created

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept``: each one's index before, -1 = new."""
        carry_over(self, _FILLS, kept)
        self._followers = followers

    def forget_heights(self) -> None:
        """Has every heightfield replaced at the next `apply`."""
        self._heights[:] = np.nan

    def apply(
        self, batch: GridBatch, rows: IntArray, base: FloatArray, twist: FloatArray | None, edge_filter: bool
    ) -> None:
        """Gives the followers in ``rows`` (m,) of a batch their colliders: at ``base`` (m, 3) [m], with the ground's
        ``twist`` (m, 6), None = at rest."""
        bodies, spacing = batch.bodies[rows], batch.spacing[rows]
        relative = batch.heights_w[rows] - base[:, 2:]
        if batch.may_have_holes:
            np.nan_to_num(relative, copy=False, nan=-BOUND)
        np.clip(relative, -BOUND, BOUND, out=relative)
        size = batch.template.size
        unfit = (self._sizes[bodies] != size) | (self._spacings[bodies] != spacing)
        for index in np.flatnonzero(unfit).tolist():
            self._fit(int(bodies[index]), size, float(spacing[index]))
        self._replace(bodies, relative, size, edge_filter)
        self._move(bodies, base, batch.heightmap.geometry.yaw, twist)

    def release(self, index: int) -> None:
        """Takes a follower's heightfield away, if it has one."""
        follower = self._followers[index]
        field = self._fields.pop(follower, None)
        if field is not None:
            self._pool.give_back(field, follower.body, follower.link)
            follower.collider = None
            self._sizes[index] = 0

    def _fit(self, index: int, size: int, spacing: float) -> None:
        """Gives a follower a heightfield of another size."""
        self.release(index)
        follower = self._followers[index]
        field = self._fields[follower] = self._pool.take(size, spacing, follower.body, follower.link)
        follower.collider = field.body
        self._sizes[index], self._spacings[index] = size, spacing
        self._shapes[index], self._colliders[index] = field.shape, field.body
        self._heights[index] = np.nan
        self._poses[index] = np.nan
        self._twists[index] = 0.0

    def _replace(self, bodies: IntArray, relative: FloatArray, size: int, edge_filter: bool) -> None:
        count = size * size
        if count > self._heights.shape[1]:
            room = np.full((len(self._heights), count - self._heights.shape[1]), np.nan)
            self._heights = np.concatenate([self._heights, room], axis=1)
            self._contact_heights = np.concatenate([self._contact_heights, room], axis=1)
        # The largest difference is NaN, and so not small, where the collider is new.
        difference = np.abs(relative - self._heights[bodies, :count]).max(axis=1)
        changed = np.flatnonzero(~(difference <= SAME_HEIGHT))
        if changed.size:
            self.replacements += len(changed)
            new, bodies = relative[changed], bodies[changed]
            self._heights[bodies, :count] = new
            fallen = (self._contact_heights[bodies, :count] - new).max(axis=1)
            self._drop_contacts(bodies[~(fallen <= STALE)], count)
            self._calls.replace_heightfields(
                self._shapes[bodies].tolist(), size, new[:, collider_order(size)].tolist(), edge_filter
            )

    def _drop_contacts(self, bodies: IntArray, count: int) -> None:
        """Has PyBullet forget the contacts of colliders whose surface sank away from them."""
        self._contact_heights[bodies, :count] = self._heights[bodies, :count]
        for index in bodies.tolist():
            follower = self._followers[index]
            self._pool.forget_contacts(self._fields[follower], follower.body, follower.link)

    def _move(self, bodies: IntArray, base: FloatArray, yaw: float, twist: FloatArray | None) -> None:
        """Puts colliders where they belong and gives them the ground's twist."""
        pose = np.empty((len(base), 4))
        pose[:, :3] = base
        pose[:, 3] = yaw
        old_twist = self._twists[bodies]
        if twist is None:
            twist = np.zeros_like(old_twist)
        # A collider that carries a velocity is moved on by the step itself, so it is put back even if nothing changed;
        # and PyBullet stops what is put somewhere.
        carried = twist.any(axis=1)
        moved = old_twist.any(axis=1) | (pose != self._poses[bodies]).any(axis=1)
        turned = (moved & carried) | (twist != old_twist).any(axis=1)
        if moved.any():
            self._poses[bodies] = pose
            self._calls.set_positions(self._colliders[bodies[moved]].tolist(), base[moved].tolist(), collider_yaw(yaw))
        if turned.any():
            self._twists[bodies] = twist
            self._calls.set_velocities(self._colliders[bodies[turned]].tolist(), twist[turned].tolist())
