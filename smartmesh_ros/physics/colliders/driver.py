"""Colliders under followers: plans their changes and passes these to PyBullet."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import SELECTION, PatchConfig, is_mesh
from smartmesh_ros.patches.selector import Selector
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.colliders.field import plan_field, replace_field
from smartmesh_ros.physics.colliders.kinds import Kind
from smartmesh_ros.physics.colliders.mesh import MeshColliders
from smartmesh_ros.physics.colliders.pairs import Pairs
from smartmesh_ros.physics.colliders.plane import plan_plane
from smartmesh_ros.physics.colliders.pool import Collider, ColliderPool
from smartmesh_ros.physics.colliders.table import (
    COLLIDERS,
    MISFIT,
    NOTHING,
    POSE,
    SAMPLES,
    VELOCITY,
    Limits,
    moves_nowhere,
)
from smartmesh_ros.physics.followers import Follower, Followers
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.moving_grid import MovingGrid

PLANE, FIELD = int(Kind.PLANE), int(Kind.FIELD)  # for compiled functions


class Plan(NamedTuple):
    """Changes that PyBullet needs, by slot: bits of ``changes`` (S,), ``poses`` (S, 7), ``velocities`` (S, 6), and the
    place of the collider that each follower needs now, ``wanted`` (S,), -1 = none."""

    changes: IntArray
    poses: FloatArray
    velocities: FloatArray
    wanted: IntArray


@compiled
def plan(grid, tile, chosen, supports, shapes, samples, time, limits, table, held, memory, planned):
    """Plan the changes for the followers in the slots ``chosen`` (n,) on a tile; returns the number of followers
    without a fitting collider.

    ``table``: of the colliders; ``held`` (S, kinds): places of the followers' colliders in it, -1 = none; ``memory``: a
    `FieldMemory`; ``planned``: a `Plan`.
    """
    misfits = 0
    changes, wanted = planned.changes, planned.wanted
    for k in range(len(chosen)):
        i = chosen[k]
        if supports[i].tile != tile or (wanted[i] >= 0 and changes[i] != MISFIT):
            continue
        pose, velocity = planned.poses[i], planned.velocities[i]
        if supports[i].state == Support.PLANE:
            wanted[i], changes[i] = held[i, PLANE], MISFIT
            if wanted[i] >= 0:
                changes[i] = plan_plane(table[wanted[i]], supports[i], shapes.table[i], time, limits, pose, velocity)
        elif supports[i].state == Support.FIELD:
            wanted[i], changes[i] = held[i, FIELD], MISFIT
            if wanted[i] >= 0:
                changes[i] = plan_field(
                    grid, table[wanted[i]], supports[i], samples, time, limits, memory, pose, velocity
                )
        if changes[i] == MISFIT:
            misfits += 1
    return misfits


@compiled
def note_changes(chosen: IntArray, active: IntArray, planned: Plan, changed: BoolArray) -> IntArray:
    """Write to ``changed`` (S,) which followers' colliders change, and return the slots (n,) of those in ``chosen``
    that need another collider than their ``active`` one (S,)."""
    changed[:] = planned.changes != NOTHING
    differs = np.empty(len(chosen), np.int64)
    count = 0
    for k in range(len(chosen)):
        i = chosen[k]
        if active[i] != planned.wanted[i]:
            changed[i] = True
            differs[count] = i
            count += 1
    return differs[:count]


class Colliders:
    """Boxes, fields and meshes of followers, addressed by slot. ``changed`` (S,): followers whose collider the last
    update changed, moved, added or removed."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self.replacements = 0
        self._client_id: int = getattr(client, "_client", 0)
        self._followers = followers
        pairs = Pairs(client)
        self.pool = ColliderPool(client, pairs)
        self.meshes = MeshColliders(client, pairs)
        self._plan = Plan(np.empty(0, np.int64), np.empty((0, 7)), np.empty((0, 6)), np.empty(0, np.int64))
        self.changed: BoolArray = np.empty(0, bool)

    def reserve(self, slots: int) -> None:
        """Make room for followers in ``slots`` slots."""
        self.pool.reserve(slots)
        changes, poses, velocities, wanted = self._plan
        self._plan = Plan(
            with_rows(changes, slots, NOTHING), with_rows(poses, slots, 0.0), with_rows(velocities, slots, 0.0),
            with_rows(wanted, slots, -1),
        )  # fmt: skip
        self.changed = with_rows(self.changed, slots, False)

    def replace_all(self) -> None:
        """Place every collider anew at the next update."""
        self.pool.table["there"] = 0

    def stand_still(self, duration: float) -> None:
        """Note that time advanced by ``duration`` [s] without a step, so that colliders did not move."""
        self.pool.table["time"] += duration

    def apply(self, selector: Selector, time: float, config: PatchConfig, *, exact: bool) -> None:
        """Set the colliders of the awake followers to their supports at ``time`` [s]; ``exact``: without tolerance,
        because a correction has just moved bodies."""
        chosen = self._followers.solid
        changes, _, _, wanted = self._plan
        changes[:], wanted[:] = NOTHING, -1
        limits = Limits(
            0.0 if exact else SELECTION.collider_slack * config.tolerance, config.carry_velocity,
            COLLIDERS.same_height, COLLIDERS.same_velocity, COLLIDERS.elsewhere, COLLIDERS.sunk, COLLIDERS.hole,
        )  # fmt: skip
        if config.grid_kind == "heightfield":
            for name, number in selector.terrain.numbers.items():
                mesh = selector.terrain.tiles[name]
                if isinstance(mesh, HeightMap):
                    self._plan_tile(mesh.moved_to(time), number, chosen, selector, time, limits)
        differs = note_changes(chosen, self.pool.active, self._plan, self.changed).tolist()
        for slot in differs:
            if self.pool.active[slot] >= 0:
                self.pool.put_away(self._followers[slot], time)
        for slot in differs:
            if wanted[slot] >= 0:
                self.pool.activate(self._followers[slot], int(wanted[slot]))
        self._send_changes(selector.supports, edge_filter=config.edge_filter)
        self.pool.trim(self._followers, time)

    def apply_meshes(self, batches: list[PatchBatch], supports: Any, config: PatchConfig) -> None:
        """Update the mesh colliders of the awake followers whose patches are in ``batches``."""
        for batch in batches:
            if is_mesh(batch.kind):
                rows = np.flatnonzero(np.isin(batch.bodies, self._followers.solid)).tolist()
                self.meshes.apply_batch(batch, rows, supports, self._followers, config)
        self.changed[self.meshes.changed] = True
        self.meshes.changed.clear()

    def release_meshes(self, batches: list[PatchBatch]) -> None:
        """Remove the mesh colliders of awake followers without a mesh patch in ``batches``."""
        if self.meshes.count:
            served = {slot for batch in batches if is_mesh(batch.kind) for slot in batch.bodies.tolist()}
            for slot in self._followers.solid.tolist():
                if slot not in served and self.meshes.release(self._followers[slot]):
                    self.meshes.changed.append(slot)

    def release(self, follower: Follower, time: float) -> None:
        """Remove a follower's colliders."""
        self.pool.release(follower, time)
        self.meshes.release(follower)
        follower.collider = None

    def _plan_tile(
        self, grid: MovingGrid, tile: int, chosen: IntArray, selector: Selector, time: float, limits: Limits
    ) -> None:
        """Plan the changes for the followers on a tile, after allocating colliders that fit."""
        for _ in range(2):
            pool = self.pool
            misfits = plan(
                grid, tile, chosen, selector.supports, self._followers.shapes, selector.samples, time, limits,
                pool.table, pool.held, pool.memory, self._plan,
            )  # fmt: skip
            if not misfits:
                return
            for slot in chosen[self._plan.changes[chosen] == MISFIT].tolist():
                support = selector.supports[slot]
                kind = Kind.PLANE if support["state"] == Support.PLANE else Kind.FIELD
                pool.fit(self._followers[slot], kind, support, grid.resolution, time)

    def _send_changes(self, supports: Any, *, edge_filter: bool) -> None:
        """Send the changes to PyBullet: samples before poses before velocities.

        The fields of balls are filtered only while the ground is at rest. Edges take little speed from a ball, and the
        filter costs a fifth of its step where the ground moves.
        """
        changed = np.flatnonzero(self._plan.changes)
        if not changed.size:
            return
        pool, client = self.pool, self._client_id
        colliders, places = pool.colliders, pool.active[changed]
        turned = pool.table["turned"][places].tolist()
        still = moves_nowhere(supports, changed).tolist()
        poses, velocities = self._plan.poses[changed].tolist(), self._plan.velocities[changed].tolist()
        set_pose, set_velocity = pb.resetBasePositionAndOrientation, pb.resetBaseVelocity
        for row, (slot, change, place) in enumerate(
            zip(changed.tolist(), self._plan.changes[changed].tolist(), places.tolist(), strict=True)
        ):
            collider = colliders[place]
            if change & SAMPLES:
                filtered = edge_filter and (still[row] or not self._followers[slot].ball)
                self._replace_samples(collider, turned[row], filtered)
            if change & POSE:
                pose = poses[row]
                set_pose(collider.uid, pose[:3], pose[3:], client)
            if change & VELOCITY:
                velocity = velocities[row]
                set_velocity(collider.uid, velocity[:3], velocity[3:], client)

    def _replace_samples(self, collider: Collider, turned: int, filtered: bool) -> None:
        """Replace the heights of a field."""
        self.replacements += 1
        rows, columns, _ = collider.key
        values = self.pool.memory.heights[collider.first : collider.first + rows * columns].tolist()
        if turned:
            values.reverse()
        replace_field(self._client_id, collider.shape, rows, columns, values, filtered=filtered)
