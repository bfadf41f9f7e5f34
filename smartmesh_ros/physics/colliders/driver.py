"""Colliders under followers: allocates them, and passes their changes to PyBullet."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.carry_over import carried_over
from smartmesh_ros.patches.config import SELECTION, PatchConfig
from smartmesh_ros.patches.selector import Selector
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.colliders.field import field_bound, make_field, plan_field, replace_field
from smartmesh_ros.physics.colliders.mesh import MeshColliders
from smartmesh_ros.physics.colliders.pairs import Pairs
from smartmesh_ros.physics.colliders.plane import box_size, make_box, plan_plane, plane_need
from smartmesh_ros.physics.colliders.table import (
    COLLIDER,
    COLLIDERS,
    MISFIT,
    NOTHING,
    POSE,
    SAMPLES,
    VELOCITY,
    Limits,
    at_rest,
)
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.moving_grid import MovingGrid

# Parking place of unused colliders [m]: far below the terrain, and apart from one another.
PARK_DEPTH, PARK_STEP = -1.0e5, 1.0e3
MESH_KINDS = ("trimesh", "hull", "prisms")
LARGEST_FIELD = 4096  # upper bound on the samples of a field
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)


@compiled
def plan(
    grid, tile, solid, supports, shapes, table, planes, fields, samples, time, limits, heights, at_contact, work, poses,
    velocities, changes, wanted,
):  # fmt: skip
    """Compute the changes that PyBullet needs for the ``solid`` followers (N,) on a tile: the bits of ``changes`` (N,),
    with ``poses`` (N, 7) and ``velocities`` (N, 6).

    ``planes``, ``fields`` (N,): rows of the followers' colliders in ``table``, -1 = none; ``wanted`` (N,): the row each
    follower needs now. Returns the number of followers without a fitting collider.
    """
    misfits = 0
    for i in range(len(solid)):
        if not solid[i] or supports[i].tile != tile or (wanted[i] >= 0 and changes[i] != MISFIT):
            continue
        if supports[i].state == Support.PLANE:
            wanted[i], changes[i] = planes[i], MISFIT
            if planes[i] >= 0:
                changes[i] = plan_plane(table[planes[i]], supports[i], shapes[i], time, limits, poses[i], velocities[i])
        elif supports[i].state == Support.FIELD:
            wanted[i], changes[i] = fields[i], MISFIT
            if fields[i] >= 0:
                changes[i] = plan_field(
                    grid, table[fields[i]], supports[i], samples, time, limits, heights, at_contact, work, poses[i],
                    velocities[i],
                )  # fmt: skip
        if changes[i] == MISFIT:
            misfits += 1
    return misfits


class ColliderInfo(NamedTuple):
    """Constant data of a collider: PyBullet body and shape ids, field size, index of its first height, and the pool
    key."""

    uid: int
    form: int
    rows: int
    columns: int
    first: int
    key: tuple[float, ...]


class Colliders:
    """Boxes, fields and meshes of followers, by the follower's index.

    PyBullet leaks when shapes are created and removed, so boxes and fields are never removed: a collider whose body
    left, or that has the wrong size, waits in a pool for the next body that needs it. A follower keeps one collider of
    each kind, because changing which pairs may touch costs more than moving a collider away and back.
    """

    def __init__(self, client: Any) -> None:
        self.replacements = 0
        self.exact = False  # place colliders without tolerance, because a correction has just moved bodies
        self._client = client
        self._client_id: int = getattr(client, "_client", 0)
        self._pairs = Pairs(client)
        self.meshes = MeshColliders(client, self._pairs)
        self._visual: int | None = None
        self._boxes: dict[float, int] = {}  # PyBullet's shapes, by half edge [m]
        self._free: dict[tuple[float, ...], list[int]] = defaultdict(list)
        self._made: list[ColliderInfo] = []  # constant data of the colliders in the table
        self.table = np.zeros(0, COLLIDER).view(np.recarray)
        self._plain = self.table.view(np.ndarray)  # the same table, whose columns are read faster
        self._heights, self._at_contact = np.empty(0), np.empty(0)
        self._work = np.empty(LARGEST_FIELD)
        self._followers: list[Follower] = []
        self._planes, self._fields = np.empty(0, np.int64), np.empty(0, np.int64)
        self._active, self._wanted = np.empty(0, np.int64), np.empty(0, np.int64)  # in the table, -1 = none
        self._solid = np.empty(0, bool)
        self._poses, self._velocities = np.empty((0, 7)), np.empty((0, 6))
        self._changes = np.empty(0, np.int64)
        self.changed = np.empty(0, bool)  # followers whose collider the last update changed, moved, added or removed

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Replace the list of followers; ``kept`` (N,): each one's previous index, -1 = new."""
        count = len(followers)
        self._followers = followers
        self._planes = carried_over(self._planes, kept, np.full(count, -1))
        self._fields = carried_over(self._fields, kept, np.full(count, -1))
        self._active = carried_over(self._active, kept, np.full(count, -1))
        self._poses, self._velocities = np.empty((count, 7)), np.empty((count, 6))
        self._changes, self._wanted = np.zeros(count, np.int64), np.full(count, -1)
        self.changed = np.zeros(count, bool)
        self._solid = np.array([follower.solid for follower in followers], bool)

    def renew(self, followers: list[int]) -> None:
        """Place the colliders of followers anew at the next update, dropping their cached contacts."""
        for index in followers:
            for mine in (self._planes[index], self._fields[index]):
                if mine >= 0:
                    self._plain["there"][mine] = self._plain["turned"][mine] = 0

    def replace_all(self) -> None:
        """Place every collider anew at the next update."""
        self._plain["there"] = 0

    def stand_still(self, duration: float) -> None:
        """Note that time advanced by ``duration`` [s] without a step, so that colliders did not move."""
        self._plain["time"] += duration

    def apply(self, selector: Selector, shapes: Any, time: float, config: PatchConfig) -> None:
        """Set the colliders to the supports at ``time`` [s]."""
        self._changes[:], self._wanted[:] = NOTHING, -1
        limits = Limits(
            0.0 if self.exact else SELECTION.collider_slack * config.tolerance, config.carry_velocity,
            COLLIDERS.same_height, COLLIDERS.same_velocity, COLLIDERS.elsewhere, COLLIDERS.sunk, COLLIDERS.hole,
        )  # fmt: skip
        if config.grid_kind == "heightfield":
            for tile, name in enumerate(selector.names):
                mesh = selector.terrain.tiles[name]
                if isinstance(mesh, HeightMap):
                    self._plan(mesh.moved_to(time), tile, selector, shapes, time, limits)
        differs = self._active != self._wanted
        self.changed = differs | (self._changes != NOTHING)
        if differs.any():
            self._put_away(np.flatnonzero(differs & (self._active >= 0)))
            self._activate()
        self._send_changes(selector.supports, edge_filter=config.edge_filter)

    def apply_meshes(self, batches: list[PatchBatch], supports: Any, config: PatchConfig) -> None:
        """Update the mesh colliders of the patches in ``batches``."""
        for batch in batches:
            if batch.kind in MESH_KINDS:
                rows = [row for row, body in enumerate(batch.bodies.tolist()) if self._followers[body].solid]
                self.meshes.apply_batch(batch, rows, supports, self._followers, config)
        self.changed[self.meshes.changed] = True
        self.meshes.changed.clear()

    def release_meshes(self, batches: list[PatchBatch]) -> None:
        """Remove the mesh colliders of followers without a mesh patch in ``batches``."""
        if self.meshes.count:
            served = {body for batch in batches if batch.kind in MESH_KINDS for body in batch.bodies.tolist()}
            for index, follower in enumerate(self._followers):
                if index not in served and self.meshes.release(follower):
                    self.meshes.changed.append(index)

    def release(self, index: int) -> None:
        """Remove a follower's colliders."""
        self._give_back(index, self._planes)
        self._give_back(index, self._fields)
        self.meshes.release(self._followers[index])
        self._followers[index].collider = None

    def _plan(self, grid: MovingGrid, tile: int, selector: Selector, shapes: Any, time: float, limits: Limits) -> None:
        """Plan the changes for the followers on a tile, after allocating colliders that fit."""
        for _ in range(2):
            misfits = plan(
                grid, tile, self._solid, selector.supports, shapes, self.table, self._planes, self._fields,
                selector.samples, time, limits, self._heights, self._at_contact, self._work, self._poses,
                self._velocities, self._changes, self._wanted,
            )  # fmt: skip
            if not misfits:
                return
            for index in np.flatnonzero(self._changes == MISFIT).tolist():
                support = selector.supports[index]
                if support.state == Support.PLANE:
                    self._fit_box(index, float(plane_need(support, shapes[index])), time)
                else:
                    self._fit_field(index, support, grid.resolution, time)

    def _fit_box(self, index: int, need: float, time: float) -> None:
        """Allocate a box of at least the size ``need`` [m], or a half space, for a follower."""
        size = box_size(need, round_=self._followers[index].round)
        self._give_back(index, self._planes)
        if not self._free[(size,)]:
            if size not in self._boxes:
                self._boxes[size] = make_box(self._client, size)
            record = self._new(self._boxes[size], -1, 0, 0, (size,))
            record.extent, record.depth, record.nz = size, 0.0 if size == math.inf else size, 1.0
        self._hand_out(index, self._free[(size,)].pop(), self._planes, time)

    def _fit_field(self, index: int, support: Any, resolution: float, time: float) -> None:
        """Allocate a field of the support's size for a follower."""
        rows, columns, spacing = int(support.rows), int(support.columns), resolution * int(support.stride)
        key = (rows, columns, spacing)
        self._give_back(index, self._fields)
        if not self._free[key]:
            if self._visual is None:
                # Without a visual shape PyBullet creates one of the whole field, which takes a few MiB.
                self._visual = self._client.createVisualShape(pb.GEOM_BOX, halfExtents=[1e-3] * 3)
            form = make_field(self._client, rows, columns, spacing, field_bound(rows, columns, spacing))
            record = self._new(form, self._visual, rows, columns, key)
            record.spacing = spacing
        self._hand_out(index, self._free[key].pop(), self._fields, time)

    def _new(self, form: int, visual: int, rows: int, columns: int, key: tuple[float, ...]) -> Any:
        """Create a collider in the pool and return its record. It is a multibody, because contacts ignore the velocity
        of a fixed rigid body."""
        place, first = len(self._made), len(self._heights)
        uid = int(self._client.createMultiBody(0.0, form, visual, basePosition=park(place)))
        # PyBullet multiplies the coefficients of the two bodies, so 1 leaves the body's own coefficients in effect.
        self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        self._pairs.claim(uid)
        self._made.append(ColliderInfo(uid, form, rows, columns, first, key))
        self._heights = np.concatenate([self._heights, np.full(rows * columns, np.nan)])
        self._at_contact = np.concatenate([self._at_contact, np.full(rows * columns, np.nan)])
        if place == len(self.table):
            table = np.zeros(2 * place + 8, COLLIDER).view(np.recarray)
            table[:place] = self.table
            self.table, self._plain = table, table.view(np.ndarray)
        record = self.table[place]
        record.rows, record.columns, record.first = rows, columns, first
        self._free[key].append(place)
        return record

    def _hand_out(self, index: int, place: int, holders: IntArray, time: float) -> None:
        follower, record = self._followers[index], self.table[place]
        record.there, record.turned, record.time = 0, 0, time
        self._pairs.join(self._made[place].uid, follower.body, follower.link)
        holders[index] = place

    def _give_back(self, index: int, holders: IntArray) -> None:
        """Return a collider that a follower no longer needs to the pool."""
        place = int(holders[index])
        if place < 0:
            return
        holders[index] = -1
        follower = self._followers[index]
        if self._active[index] == place:
            self._put_away(np.array([index]))
        self._pairs.part(self._made[place].uid, follower.body, follower.link)
        self._free[self._made[place].key].append(place)

    def _put_away(self, followers: IntArray) -> None:
        """Park the colliders of followers."""
        for index in followers.tolist():
            place = int(self._active[index])
            uid = self._made[place].uid
            pb.resetBasePositionAndOrientation(uid, park(place), UPRIGHT, self._client_id)
            pb.resetBaseVelocity(uid, STILL, STILL, self._client_id)
            for name in ("there", "vx", "vy", "vz", "wx", "wy", "wz"):
                self._plain[name][place] = 0
            self._active[index] = -1
            self._followers[index].collider = None

    def _activate(self) -> None:
        """Record the colliders that followers use now."""
        for index in np.flatnonzero(self._active != self._wanted).tolist():
            place = int(self._wanted[index])
            self._active[index] = place
            self._followers[index].collider = self._made[place].uid

    def _send_changes(self, supports: Any, *, edge_filter: bool) -> None:
        """Send the changes to PyBullet: samples before poses before velocities.

        The fields of balls are filtered only while the ground is at rest. Edges take little speed from a ball, and the
        filter costs a fifth of its step where the ground moves.
        """
        changed = np.flatnonzero(self._changes)
        if not changed.size:
            return
        places = self._active[changed]
        turned, client = self._plain["turned"][places].tolist(), self._client_id
        still = at_rest(supports.view(np.ndarray)[changed])
        poses, velocities = self._poses[changed].tolist(), self._velocities[changed].tolist()
        set_pose, set_velocity = pb.resetBasePositionAndOrientation, pb.resetBaseVelocity
        for row, (index, change, place) in enumerate(
            zip(changed.tolist(), self._changes[changed].tolist(), places.tolist(), strict=True)
        ):
            made = self._made[place]
            if change & SAMPLES:
                self._replace(made, turned[row], edge_filter and (still[row] or not self._followers[index].ball))
            if change & POSE:
                pose = poses[row]
                set_pose(made.uid, pose[:3], pose[3:], client)
            if change & VELOCITY:
                velocity = velocities[row]
                set_velocity(made.uid, velocity[:3], velocity[3:], client)

    def _replace(self, made: ColliderInfo, turned: int, filtered: bool) -> None:
        """Replace the heights of a field."""
        self.replacements += 1
        heights = self._heights[made.first : made.first + made.rows * made.columns].tolist()
        if turned:
            heights.reverse()
        replace_field(self._client_id, made.form, made.rows, made.columns, heights, filtered=filtered)


def park(place: int) -> tuple[float, float, float]:
    """Parking place of a collider [m]."""
    return place * PARK_STEP, 0.0, PARK_DEPTH
