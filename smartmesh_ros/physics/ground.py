"""Colliders that follow bodies: the whole product for a PyBullet user."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.extent import MOST_RINGS
from smartmesh_ros.patches.tracker import PatchBatch, PatchTracker
from smartmesh_ros.physics.bounds import bounding_radius
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
        self._get_pose = client.getBasePositionAndOrientation
        self._set_pose = client.resetBasePositionAndOrientation
        self._set_velocity = client.resetBaseVelocity
        self._tracker = PatchTracker(self.terrain, self.config, self.stopwatch)
        self._pool = HeightfieldPool(client)
        self._followers: list[Follower] = []
        self._changed = False
        self._positions = np.empty((0, 3))
        # What the colliders were last given: heights [m], base position [m], yaw [rad] and twist [m/s, rad/s].
        self._heights = np.empty((0, (2 * MOST_RINGS + 1) ** 2))
        self._poses = np.empty((0, 4))
        self._twists = np.empty((0, 6))

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
        for follower in self._followers:
            if follower.body == body:
                self._release(follower)
        self._adopt([follower for follower in self._followers if follower.body != body])

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings for patches, from the next update on."""
        if config.edge_filter != self.config.edge_filter:
            self._heights[:] = np.nan
        self.config = self._tracker.config = config

    def update(self, time: float, dt: float) -> None:
        """Brings every patch to where its body and the ground are at ``time`` [s], before a step of ``dt`` [s]."""
        positions = self._read_positions()
        travel = np.linalg.norm(positions - self._positions, axis=1)
        np.minimum(np.nan_to_num(travel), FASTEST * dt, out=travel)
        self._positions = positions
        self.batches = self._tracker.update(positions, travel, time)
        with self.stopwatch.stage("collider"):
            supported = np.zeros(len(self._followers), bool)
            for batch in self.batches:
                supported[self._apply(batch)] = True
            for index in np.flatnonzero(~supported):
                self._release(self._followers[index])

    def close(self) -> None:
        """Takes all patches away."""
        for follower in self._followers:
            self._release(follower)
        self._adopt([])

    def _adopt(self, followers: list[Follower]) -> None:
        """Makes ``followers`` the attached ones; what is known of those that stay is kept."""
        before = {id(follower): index for index, follower in enumerate(self._followers)}
        kept = np.array([before.get(id(follower), -1) for follower in followers], np.int64)
        known = kept >= 0
        for name, fill in (("_heights", np.nan), ("_poses", np.nan), ("_twists", np.nan), ("_positions", np.nan)):
            old = getattr(self, name)
            new = np.full((len(followers), old.shape[1]), fill)
            new[known] = old[kept[known]]
            setattr(self, name, new)
        self._followers = followers
        self._tracker.set_bodies(np.array([follower.radius for follower in followers]), kept)

    def _read_positions(self) -> FloatArray:
        get_pose, get_link = self._get_pose, self._client.getLinkState
        positions = [
            get_pose(follower.body)[0] if follower.link < 0 else get_link(follower.body, follower.link)[0]
            for follower in self._followers
        ]
        return np.array(positions, np.float64).reshape(-1, 3)

    def _apply(self, batch: PatchBatch) -> IntArray:
        """Gives the colliders of a batch what changed; returns the followers that have ground under them."""
        heights = batch.heights_w
        base = batch.centres_w.copy()
        if batch.heightmap.has_holes:
            holes = np.isnan(heights)
            grounded = np.asarray(~holes.all(axis=1))
            hollow = grounded & holes[:, batch.template.centre]
            base[hollow, 2] = np.nanmean(heights[hollow], axis=1)
        else:
            grounded = np.ones(len(heights), bool)
        relative = np.nan_to_num(heights - base[:, 2:], copy=False, nan=-BOUND)
        np.clip(relative, -BOUND, BOUND, out=relative)

        followers = self._followers
        members = [i for i, index in enumerate(batch.bodies) if grounded[i] and followers[index].solid]
        if not members:
            return batch.bodies[grounded]
        bodies = batch.bodies[members]
        relative, base = relative[members], base[members]
        spacing = batch.spacing[members].tolist()
        for index, distance in zip(bodies.tolist(), spacing, strict=True):
            self._fit(index, batch.template.size, distance)
        self._replace(bodies, relative, batch.template.size)
        self._move(bodies, base, batch, members)
        return batch.bodies[grounded]

    def _fit(self, index: int, size: int, spacing: float) -> None:
        """Sees to it that a follower has a heightfield of that size."""
        follower = self._followers[index]
        heightfield = follower.heightfield
        if heightfield is not None:
            if heightfield.size == size and heightfield.spacing == spacing:
                return
            self._release(follower)
        follower.heightfield = self._pool.take(size, spacing, follower.body, follower.link)
        self._heights[index] = np.nan
        self._poses[index] = np.nan
        self._twists[index] = np.nan

    def _replace(self, bodies: IntArray, relative: FloatArray, size: int) -> None:
        count = size * size
        same = np.abs(relative - self._heights[bodies, :count]) <= SAME_HEIGHT
        changed = np.flatnonzero(~same.all(axis=1))
        if not changed.size:
            return
        self.replacements += len(changed)
        new = relative[changed]
        self._heights[bodies[changed], :count] = new
        followers, edge_filter = self._followers, self.config.edge_filter
        for index, heights in zip(bodies[changed].tolist(), new[:, collider_order(size)].tolist(), strict=True):
            followers[index].heightfield.replace(heights, edge_filter)

    def _move(self, bodies: IntArray, base: FloatArray, batch: PatchBatch, members: list[int]) -> None:
        yaw = batch.heightmap.geometry.yaw
        pose = np.column_stack([base, np.full(len(base), yaw)])
        twist = np.zeros((len(base), 6))
        if self.config.carry_velocity:
            twist[:, :3] = batch.linear_w[members]
            twist[:, 3:] = batch.angular_w[members]
        # A collider that carries a velocity is moved on by the step itself, so it is put back even if nothing changed.
        drifted = (self._twists[bodies] != 0.0).any(axis=1)
        moved = drifted | (pose != self._poses[bodies]).any(axis=1)
        # PyBullet stops a body whose pose is set.
        turned = (twist != self._twists[bodies]).any(axis=1) | (moved & (twist != 0.0).any(axis=1))
        self._poses[bodies] = pose
        self._twists[bodies] = twist
        orientation = collider_yaw(yaw)
        followers, set_pose, set_velocity = self._followers, self._set_pose, self._set_velocity
        colliders = [followers[index].heightfield.body for index in bodies.tolist()]
        for i, position in zip(np.flatnonzero(moved).tolist(), base[moved].tolist(), strict=True):
            set_pose(colliders[i], position, orientation)
        for i, velocity in zip(np.flatnonzero(turned).tolist(), twist[turned].tolist(), strict=True):
            set_velocity(colliders[i], velocity[:3], velocity[3:])

    def _release(self, follower: Follower) -> None:
        if follower.heightfield is not None:
            self._pool.give_back(follower.heightfield, follower.body, follower.link)
            follower.heightfield = None
