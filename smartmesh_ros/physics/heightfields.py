"""Colliders of many followers as heightfields replaced in place: only what changed touches PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.carrying import Carried, velocity_below
from smartmesh_ros.physics.drift import distance_from_ground, slopes_of, speed_astray
from smartmesh_ros.physics.fields import Fields
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.heightfield import (
    BOUND,
    DEEPEST,
    Heightfield,
    HeightfieldPool,
    collider_order,
    collider_yaw,
    room,
)
from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.physics.prediction import Ahead
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import Samples

# Heights that differ by less than this from the collider's are not worth replacing it [m].
SAME_HEIGHT = 1e-6
# A collider that moves on with the ground's velocity may lie this share of the tolerance beside the ground.
CARRIED = 0.5
# A collider whose base is further aside than this share of its spacing stands on another vertex.
ELSEWHERE = 0.01
# PyBullet keeps the contacts of a heightfield that is replaced: a body stays up where the ground sank away under it.
# They are dropped when any sample has sunk by more than this, seen from the collider's base [m].
STALE = 5e-4
# To drop them, PyBullet's body is lowered by so much under the same surface: contacts keep their places on it, part by
# as much, and are forgotten. Once it is lower than DEEPEST it comes back up, and they are dropped by telling PyBullet
# that the two may collide, for which it goes through the pairs of all bodies [m].
LOWERED = 5e-3
# Where fewer than this share of colliders would be left alone in the next step, none is for so long [s]: telling which
# costs as much as it saves.
FEW, PAUSE = 0.25, 0.1
# Ground that parts from its collider more slowly is taken to do so at this speed [m/s].
SLOWEST = 1e-6

_FILLS = {
    "_sizes": 0,
    "_spacings": 0.0,
    "_bounds": 0.0,
    "_shapes": -1,
    "_heights": np.nan,
    "_contact_heights": np.nan,
    "_yaws": 0.0,
    "_slopes": 0.0,
    "_touched": False,
    "_until": -np.inf,
}


class Heightfields:
    """The heightfields under followers, by the follower's index."""

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self.replacements = 0
        self._calls = BulletCalls(client)
        self._pool = HeightfieldPool(client, pairs)
        self._followers: list[Follower] = []
        self._fields: dict[Follower, Heightfield] = {}
        self._balls = np.empty(0, bool)  # they need no edge filter
        # The followers' colliders, size 0 = none: samples on a side, their distance [m], how far they may be above or
        # below the middle one [m], and shape.
        self._sizes = np.empty(0, np.int64)
        self._spacings = np.empty(0)
        self._bounds = np.empty(0)
        self._shapes = np.empty(0, np.int64)
        self._carried = Carried(client)
        # What they were last given: heights [m].
        self._heights = np.empty((0, 81))
        # Their yaw when placed [rad], how much they turned from level since, as slope per row and per column of the
        # grid, and until when they lie along the ground if that goes on as it is [s].
        self._yaws = np.empty(0)
        self._slopes = np.empty((0, 2))
        self._until = np.empty(0)
        self._pause = -np.inf  # when the ground was last too lively for any to be left alone [s]
        # Heights when PyBullet last forgot their contacts [m], and which may have some.
        self._contact_heights = np.empty((0, 81))
        self._touched = np.empty(0, bool)

    @property
    def created(self) -> int:
        """Heightfields made so far."""
        return self._pool.created

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept``: each one's index before, -1 = new."""
        carry_over(self, _FILLS, kept)
        self._carried.adopt(kept)
        self._followers = followers
        self._balls = np.array([follower.ball for follower in followers], bool)

    def forget_heights(self) -> None:
        """Has every heightfield replaced at the next `apply`."""
        self._heights[:] = np.nan
        self._until[:] = -np.inf

    def renew(self, indices: list[int]) -> None:
        """Has the heightfields of followers start at the next `apply` as if they were new."""
        self._heights[indices] = self._contact_heights[indices] = np.nan
        self._touched[indices] = False
        self._carried.forget(np.array(indices, np.int64))
        self._raise(indices)

    def stand_still(self, duration: float) -> None:
        """Says that for a ``duration`` [s] time went on and colliders did not."""
        self._carried.stand_still(duration)
        self._until[:] = -np.inf

    def keeps(self, time: float) -> bool:
        """Whether colliders are to be left alone for some steps where they can."""
        return not self._pause <= time < self._pause + PAUSE

    def judge(self, bodies: IntArray, time: float, dt: float) -> None:
        """Judges by followers (m,) just served, for steps of ``dt`` [s], whether leaving colliders alone pays."""
        lasting = np.count_nonzero(self._until[bodies] >= time + dt)
        self._pause = time if lasting < FEW * len(bodies) else -np.inf

    def held(self, fields: Fields, time: float) -> BoolArray:
        """Whose collider moves on with its ground (m,), and needs no look at ``time`` [s]."""
        bodies = fields.bodies
        same = self._carried.same_ground(bodies, fields.since, time)
        return np.asarray(same & (time <= self._until[bodies]))

    def go_on(self, bodies: IntArray, faster: FloatArray, touching: BoolArray, time: float) -> None:
        """Has colliders of followers (m,) move on with their ground, ``faster`` (m,) [m/s] upwards than it was said to
        be; ``touching`` (m,): which bodies may have contacts from now on."""
        self._carried.hasten(bodies, faster, time)
        self._touched[bodies] |= touching

    def apply(
        self, fields: Fields, samples: Samples, base: FloatArray, ahead: Ahead, touching: BoolArray, time: float,
        config: PatchConfig,
    ) -> None:  # fmt: skip
        """Gives followers their colliders at ``time`` [s]: at ``base`` (m, 3) [m], with ``samples`` (m, K), which the
        ground is ``ahead`` of. ``touching`` (m,): which bodies may have contacts from now on.

        A collider that moved on with its velocity and still lies along the ground is left alone.
        """
        bodies, sizes = fields.bodies, fields.layout.sizes[fields.which]
        relative = samples.heights - base[:, 2:]
        if fields.holes:
            np.nan_to_num(relative, copy=False, nan=-BOUND)
        np.minimum(np.maximum(relative, -BOUND, out=relative), BOUND, out=relative)
        base[:, 2] += ahead.higher
        bounds = room(sizes, fields.spacing, np.maximum(relative.max(axis=1), -relative.min(axis=1)))
        unfit = (self._sizes[bodies] != sizes) | (self._spacings[bodies] != fields.spacing)
        unfit |= bounds > self._bounds[bodies]
        for index in np.flatnonzero(unfit).tolist():
            self._fit(int(bodies[index]), int(sizes[index]), float(fields.spacing[index]), float(bounds[index]))
        self._make_room(relative.shape[1])
        yaw = fields.heightmap.geometry.yaw
        self._slopes[bodies] += slopes_of(self._carried.advance(bodies, time), yaw)
        off = self._distance(fields, base, relative)
        # The distance is NaN, and so not small, where the collider is new.
        moves = self._carried.twists[bodies].any(axis=1)
        chosen = np.flatnonzero(~(off <= np.where(moves, CARRIED * config.tolerance, SAME_HEIGHT)))
        if chosen.size:
            touched = touching | self._touched[bodies]
            self._replace(fields, chosen, relative, touched, config.edge_filter)
            self._place(bodies[chosen], base[chosen], yaw)
            off[chosen] = 0.0
        self._touched[bodies] = touching
        twist = np.zeros((len(bodies), 6))
        if config.carry_velocity:
            twist[:, :3], twist[:, 3:] = fields.linear_w, fields.angular_w
            if fields.points_w is not None:
                twist[:, :3] += velocity_below(fields.angular_w, fields.points_w[:, 2] - fields.centres_w[:, 2])
        self._carried.push(bodies, twist, ahead.faster, fields.since)
        self._until[bodies] = -np.inf
        if samples.velocities is not None:
            astray = speed_astray(fields, samples.velocities, twist, yaw)
            self._until[bodies] = time + (CARRIED * config.tolerance - off) / np.maximum(astray, SLOWEST)

    def put_away(self, indices: IntArray) -> None:
        """Has the heightfields of followers wait far away until they are needed again."""
        if indices.size:
            parks = [self._fields[self._followers[index]].park_position for index in indices.tolist()]
            self._place(indices, np.array(parks), 0.0)
            self._carried.forget(indices)

    def release(self, index: int) -> None:
        """Takes a follower's heightfield away, if it has one."""
        follower = self._followers[index]
        field = self._fields.pop(follower, None)
        if field is not None:
            self._pool.give_back(field, follower.body, follower.link)
            follower.collider = None
            self._carried.forget(index)
            self._sizes[index] = 0

    def _fit(self, index: int, size: int, spacing: float, bound: float) -> None:
        """Gives a follower a heightfield of another size."""
        self.release(index)
        follower = self._followers[index]
        field = self._fields[follower] = self._pool.take(size, spacing, bound + DEEPEST, follower.body, follower.link)
        follower.collider = field.body
        self._sizes[index], self._spacings[index], self._bounds[index] = size, spacing, bound
        self._shapes[index], self._carried.colliders[index] = field.shape, field.body
        self._heights[index] = np.nan
        self._carried.forget(index)

    def _make_room(self, count: int) -> None:
        """Makes room for patches of so many samples."""
        if count > self._heights.shape[1]:
            room = np.full((len(self._heights), count - self._heights.shape[1]), np.nan)
            self._heights = np.concatenate([self._heights, room], axis=1)
            self._contact_heights = np.concatenate([self._contact_heights, room], axis=1)

    def _distance(self, fields: Fields, base: FloatArray, relative: FloatArray) -> FloatArray:
        """How far the colliders are from where they should be (m,) [m], NaN = unknown."""
        bodies, yaw = fields.bodies, fields.heightmap.geometry.yaw
        aside = self._carried.bases[bodies] - base
        old = self._heights[bodies, : relative.shape[1]]
        distance = distance_from_ground(fields, relative, old, aside[:, 2], self._slopes[bodies])
        elsewhere = np.abs(aside[:, :2]).max(axis=1) > ELSEWHERE * fields.spacing
        distance[elsewhere | (self._yaws[bodies] != yaw)] = np.inf
        return distance

    def _replace(
        self, fields: Fields, rows: IntArray, relative: FloatArray, touched: BoolArray, edge_filter: bool
    ) -> None:
        """Gives the colliders in ``rows`` their new heights (m, K) [m] where they differ from those they have."""
        bodies, new = fields.bodies[rows], relative[rows]
        room = slice(new.shape[1])
        same = np.abs(new - self._heights[bodies, room]).max(axis=1) <= SAME_HEIGHT
        if same.any():
            rows, bodies, new = rows[~same], bodies[~same], new[~same]
        if not bodies.size:
            return
        self.replacements += len(bodies)
        self._heights[bodies, room] = new
        stale = ~((self._contact_heights[bodies, room] - new).max(axis=1) <= STALE)
        self._contact_heights[bodies[stale], room] = new[stale]
        self._drop_contacts(bodies[stale & touched[rows]])
        new += self._carried.depths[bodies][:, None]
        filtered = ~self._balls[bodies] if edge_filter else np.zeros(len(bodies), bool)
        for which, size in enumerate(fields.layout.sizes.tolist()):
            chosen = np.flatnonzero(fields.which[rows] == which) if fields.mixed else slice(None)
            heights = new[chosen][:, collider_order(size)]
            shapes = self._shapes[bodies[chosen]].tolist()
            self._calls.replace_heightfields(shapes, size, heights.tolist(), filtered[chosen].tolist())

    def _drop_contacts(self, bodies: IntArray) -> None:
        """Has PyBullet forget the contacts of colliders that are to be placed anew, whose surface sank away."""
        depths = self._carried.depths
        depths[bodies] += LOWERED
        self._raise(bodies[depths[bodies] > DEEPEST].tolist())

    def _raise(self, indices: list[int]) -> None:
        """Has colliders that are to be placed anew lie no lower than their ground says."""
        self._carried.depths[indices] = 0.0
        for index in indices:
            follower = self._followers[index]
            field = self._fields.get(follower)
            if field is not None:
                self._pool.forget_contacts(field, follower.body, follower.link)

    def _place(self, bodies: IntArray, base: FloatArray, yaw: float) -> None:
        """Puts colliders at ``base`` (m, 3) [m]. This stops them."""
        self._carried.place(bodies, base, collider_yaw(yaw))
        self._yaws[bodies], self._slopes[bodies] = yaw, 0.0
