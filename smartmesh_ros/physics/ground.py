"""Colliders that follow bodies: the whole product for a PyBullet user."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.extent import MOST_RINGS
from smartmesh_ros.patches.tracker import PatchBatch, PatchTracker
from smartmesh_ros.physics.bounds import bounding_radius
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.heightfield import BOUND, Heightfield, HeightfieldPool, collider_order, collider_yaw
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

# Heights that differ by less than this from the collider's are not worth replacing it [m].
SAME_HEIGHT = 1e-6
# Faster bodies do not get larger patches; a teleport is not a speed [m/s].
FASTEST = 50.0


@dataclass(eq=False)
class Follower:
    """A body or link with a patch under it. ``solid``: it gets a collider; otherwise only the patch is computed."""

    body: int
    link: int
    radius: float
    solid: bool
    heightfield: Heightfield | None = None


class Ground:
    """Keeps one small collider of a deforming terrain under each attached body of a PyBullet world.

    ``client`` is a connected `pybullet_utils.bullet_client.BulletClient` or the module ``pybullet`` itself. `attach`
    bodies, and call `update` before each ``stepSimulation``. Nothing else in the world collides with the terrain.
    """

    def __init__(
        self,
        client: Any,
        terrain: HeightMap | Terrain,
        config: PatchConfig | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.config = config or PatchConfig()
        self.terrain = Terrain.of(terrain)
        self.stopwatch = stopwatch or Stopwatch()
        self.batches: list[PatchBatch] = []
        self.replacements = 0
        self._client = client
        self._calls = BulletCalls(client)
        self._tracker = PatchTracker(self.terrain, self.config, self.stopwatch)
        self._pool = HeightfieldPool(client)
        self._followers: list[Follower] = []
        self._positions = np.empty((0, 3))
        # The followers' colliders, size 0 = none: samples on a side, their distance [m], shape and body.
        self._sizes = np.empty(0, np.int64)
        self._spacings = np.empty(0)
        self._shapes = np.empty(0, np.int64)
        self._colliders = np.empty(0, np.int64)
        # What the colliders were last given: heights [m], base position [m] and yaw [rad], twist [m/s, rad/s].
        self._heights = np.empty((0, (2 * MOST_RINGS + 1) ** 2))
        self._poses = np.empty((0, 4))
        self._twists = np.empty((0, 6))
        self._solid = np.empty(0, bool)
        self._links: list[int] = []

    @property
    def followers(self) -> list[Follower]:
        """Attached bodies and links, in the order of the indices that `batches` use."""
        return self._followers

    @property
    def positions_w(self) -> FloatArray:
        """Positions of the followers at the last update (N, 3) [m]."""
        return self._positions

    def attach(self, body: int, link: int = -1, *, radius: float | None = None, solid: bool = True) -> Follower:
        """Puts a patch under ``body`` (or its ``link``), whose sphere around its centre of mass has ``radius`` [m].

        Without a radius it is read off the body's bounds. ``solid=False`` computes the patch without a collider.
        """
        if any(follower.body == body and follower.link == link for follower in self._followers):
            raise InputError("duplicate_id", f"body {body}, link {link} is attached already; detach it first")
        size = bounding_radius(self._client, body, link) if radius is None else radius
        if not (np.isfinite(size) and size > 0.0):
            raise InputError("geometry", f"the radius of body {body}, link {link} is {size} m; it must be above zero")
        follower = Follower(body, link, size, solid)
        self._adopt([*self._followers, follower])
        return follower

    def detach(self, body: int) -> None:
        """Takes the patches of ``body`` and its links away. Call it before the body is removed from PyBullet."""
        for index, follower in enumerate(self._followers):
            if follower.body == body:
                self._release(index)
        self._adopt([follower for follower in self._followers if follower.body != body])

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings for patches, from the next update on."""
        if config.edge_filter != self.config.edge_filter:
            self._heights[:] = np.nan
        self.config = config
        self._tracker.configure(config)

    def update(self, time: float, dt: float) -> None:
        """Brings every patch to where its body and the ground are at ``time`` [s], before a step of ``dt`` [s]."""
        positions = self._read_positions()
        moved = positions - self._positions
        travel = np.sqrt(np.einsum("ij,ij->i", moved, moved))
        travel = np.where(travel < FASTEST * dt, travel, FASTEST * dt * (travel > 0.0))  # zero where NaN: it is new
        self._positions = positions
        self.batches = self._tracker.update(positions, travel, time)
        with self.stopwatch.stage("collider"):
            supported = np.zeros(len(self._followers), bool)
            for batch in self.batches:
                supported[self._apply(batch)] = True
            if not supported.all():
                for index in np.flatnonzero(~supported).tolist():
                    self._release(index)

    def close(self) -> None:
        """Takes all patches away."""
        for index in range(len(self._followers)):
            self._release(index)
        self._adopt([])

    def _adopt(self, followers: list[Follower]) -> None:
        """Makes ``followers`` the attached ones; what is known of those that stay is kept."""
        before = {id(follower): index for index, follower in enumerate(self._followers)}
        kept = np.array([before.get(id(follower), -1) for follower in followers], np.int64)
        known = kept >= 0
        for name in ("_positions", "_sizes", "_spacings", "_shapes", "_colliders", "_heights", "_poses", "_twists"):
            old = getattr(self, name)
            fill = np.nan if old.dtype.kind == "f" else 0
            new = np.full((len(followers), *old.shape[1:]), fill, old.dtype)
            new[known] = old[kept[known]]
            setattr(self, name, new)
        self._followers = followers
        self._solid = np.array([follower.solid for follower in followers], bool)
        self._links = [index for index, follower in enumerate(followers) if follower.link >= 0]
        self._tracker.set_bodies(np.array([follower.radius for follower in followers]), kept)

    def _read_positions(self) -> FloatArray:
        positions = [pose[0] for pose in self._calls.poses([follower.body for follower in self._followers])]
        for index in self._links:
            follower = self._followers[index]
            positions[index] = self._client.getLinkState(follower.body, follower.link)[0]
        return np.array(positions, np.float64).reshape(-1, 3)

    def _apply(self, batch: PatchBatch) -> IntArray:
        """Gives the colliders of a batch what changed; returns the followers that have ground under them."""
        bodies, heights, base = batch.bodies, batch.heights_w, batch.centres_w
        chosen = self._solid[bodies]
        supported = bodies
        if batch.heightmap.has_holes:
            base, grounded = _base_over_holes(base, heights)
            supported = bodies[grounded]
            chosen &= grounded
        twist = np.concatenate([batch.linear_w, batch.angular_w], axis=1) if self.config.carry_velocity else None
        spacing = batch.spacing
        if not chosen.all():
            bodies, heights, base, spacing = bodies[chosen], heights[chosen], base[chosen], spacing[chosen]
            twist = None if twist is None else twist[chosen]
        if bodies.size:
            relative = heights - base[:, 2:]
            if batch.heightmap.has_holes:
                np.nan_to_num(relative, copy=False, nan=-BOUND)
            np.clip(relative, -BOUND, BOUND, out=relative)
            size = batch.template.size
            unfit = (self._sizes[bodies] != size) | (self._spacings[bodies] != spacing)
            for i in np.flatnonzero(unfit).tolist():
                self._fit(int(bodies[i]), size, float(spacing[i]))
            self._replace(bodies, relative, size)
            self._move(bodies, base, batch.heightmap.geometry.yaw, twist)
        return supported

    def _fit(self, index: int, size: int, spacing: float) -> None:
        """Gives a follower a heightfield of another size."""
        follower = self._followers[index]
        self._release(index)
        heightfield = self._pool.take(size, spacing, follower.body, follower.link)
        follower.heightfield = heightfield
        self._sizes[index], self._spacings[index] = size, spacing
        self._shapes[index], self._colliders[index] = heightfield.shape, heightfield.body
        self._heights[index] = np.nan
        self._poses[index] = np.nan
        self._twists[index] = 0.0

    def _replace(self, bodies: IntArray, relative: FloatArray, size: int) -> None:
        count = size * size
        # The largest difference is NaN, and so not small, where the collider is new.
        difference = np.abs(relative - self._heights[bodies, :count]).max(axis=1)
        changed = np.flatnonzero(~(difference <= SAME_HEIGHT))
        if changed.size:
            self.replacements += len(changed)
            new, bodies = relative[changed], bodies[changed]
            self._heights[bodies, :count] = new
            self._calls.replace_heightfields(
                self._shapes[bodies].tolist(), size, new[:, collider_order(size)].tolist(), self.config.edge_filter
            )

    def _move(self, bodies: IntArray, base: FloatArray, yaw: float, twist: FloatArray | None) -> None:
        """Puts colliders where they belong and gives them the ground's ``twist`` (n, 6), None = at rest."""
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
            self._calls.set_poses(self._colliders[bodies[moved]].tolist(), base[moved].tolist(), collider_yaw(yaw))
        if turned.any():
            self._twists[bodies] = twist
            self._calls.set_velocities(self._colliders[bodies[turned]].tolist(), twist[turned].tolist())

    def _release(self, index: int) -> None:
        follower = self._followers[index]
        if follower.heightfield is not None:
            self._pool.give_back(follower.heightfield, follower.body, follower.link)
            follower.heightfield = None
            self._sizes[index] = 0


def _base_over_holes(centres_w: FloatArray, heights_w: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Bases of patches with holes, at the mean of their heights where the centre is one, and which have any ground."""
    holes = np.isnan(heights_w)
    grounded = np.asarray(~holes.all(axis=1))
    hollow = grounded & np.isnan(centres_w[:, 2])
    base = centres_w.copy()
    base[hollow, 2] = np.nanmean(heights_w[hollow], axis=1)
    return base, grounded
