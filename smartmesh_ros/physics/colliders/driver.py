"""The colliders under followers: which each one has, and what PyBullet is told about them."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.carry_over import carried_over
from smartmesh_ros.patches.config import SELECTION, PatchConfig
from smartmesh_ros.patches.selector import Selector
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.colliders.field import field_bound, make_field, plan_field
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
)
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.moving_grid import MovingGrid

# Where colliders wait that no body needs: far below, and apart from one another [m].
PARK_DEPTH, PARK_STEP = -1.0e5, 1.0e3
MESH_KINDS = ("trimesh", "hull", "prisms")
LARGEST_FIELD = 4096  # samples of the largest field, more than any has
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)


@compiled
def plan(  # type: ignore[no-untyped-def]
    grid, chosen, supports, shapes, table, planes, fields, samples, time, limits, heights, at_contact, work, poses,
    velocities, changes,
):  # fmt: skip
    """Works out what PyBullet has to be told for the followers in ``chosen`` (n,): the bits of ``changes`` (N,), with
    ``poses`` (N, 7) and ``velocities`` (N, 6). ``planes``, ``fields`` (N,): their colliders in ``table``, -1 = none."""
    for k in range(len(chosen)):
        i = chosen[k]
        if supports[i].state == Support.PLANE:
            changes[i] = MISFIT
            if planes[i] >= 0:
                changes[i] = plan_plane(
                    table[planes[i]], supports[i], shapes[i], time, limits, poses[i], velocities[i]
                )
        elif supports[i].state == Support.FIELD:
            changes[i] = MISFIT
            if fields[i] >= 0:
                changes[i] = plan_field(
                    grid, table[fields[i]], supports[i], samples, time, limits, heights, at_contact, work, poses[i],
                    velocities[i],
                )  # fmt: skip


class Colliders:
    """Boxes, fields and meshes of followers, by the follower's index.

    PyBullet leaks when shapes are created and removed, so boxes and fields never are: one whose body left, or that has
    the wrong size, waits for the next body that needs it. A follower keeps one of each kind, because telling PyBullet
    which pairs may touch costs more than moving a collider away and back.
    """

    def __init__(self, client: Any) -> None:
        self.replacements = 0
        self._client = client
        self._client_id: int = getattr(client, "_client", 0)
        self._calls = BulletCalls(client)
        self._pairs = Pairs(client)
        self.meshes = MeshColliders(client, self._pairs)
        self._visual: int | None = None
        self._boxes: dict[float, int] = {}  # PyBullet's shapes, by half of their edges
        self._free: dict[tuple[float, ...], list[int]] = defaultdict(list)
        self.table = np.zeros(0, COLLIDER).view(np.recarray)
        self._heights, self._at_contact = np.empty(0), np.empty(0)
        self._work = np.empty(LARGEST_FIELD)
        self._followers: list[Follower] = []
        self._planes, self._fields = np.empty(0, np.int64), np.empty(0, np.int64)
        self._active = np.empty(0, np.int64)  # in the table, -1 = none
        self._poses, self._velocities = np.empty((0, 7)), np.empty((0, 6))
        self._changes = np.empty(0, np.int64)

    def adopt(self, followers: list[Follower], kept: IntArray) -> None:
        """Makes ``followers`` the ones there are; ``kept`` (N,): each one's index before, -1 = new."""
        count = len(followers)
        self._followers = followers
        self._planes = carried_over(self._planes, kept, np.full(count, -1))
        self._fields = carried_over(self._fields, kept, np.full(count, -1))
        self._active = carried_over(self._active, kept, np.full(count, -1))
        self._poses, self._velocities = np.empty((count, 7)), np.empty((count, 6))
        self._changes = np.zeros(count, np.int64)

    def renew(self, followers: list[int]) -> None:
        """Has the colliders of followers placed anew, without contacts of before."""
        for index in followers:
            for mine in (self._planes[index], self._fields[index]):
                if mine >= 0:
                    self.table["there"][mine] = self.table["turned"][mine] = 0
                    first, count = self._samples_of(int(mine))
                    self._at_contact[first : first + count] = np.inf

    def replace_all(self) -> None:
        """Has every collider placed anew at the next update."""
        self.table["there"] = 0

    def stand_still(self, duration: float) -> None:
        """Says that for a ``duration`` [s] time went on and colliders did not."""
        self.table["time"] += duration

    def apply(self, selector: Selector, shapes: Any, time: float, config: PatchConfig) -> None:
        """Makes the colliders those of the supports at ``time`` [s]."""
        supports = selector.supports
        self._changes[:] = NOTHING
        limits = Limits(
            SELECTION.carried * config.tolerance, config.carry_velocity, COLLIDERS.same_height,
            COLLIDERS.same_velocity, COLLIDERS.elsewhere, COLLIDERS.sunk, COLLIDERS.hole,
        )  # fmt: skip
        if config.grid_kind == "heightfield":
            for name, mesh in selector.terrain.tiles.items():
                if isinstance(mesh, HeightMap):
                    chosen = selector.of_tile(name)
                    grid = mesh.moved_to(time)
                    self._plan(grid, chosen, supports, shapes, selector.samples, time, limits)
        state = supports["state"]
        fixed = state == (Support.FIELD if config.grid_kind == "heightfield" else -1)
        wanted = np.where(state == Support.PLANE, self._planes, np.where(fixed, self._fields, -1))
        wanted[~np.array([follower.solid for follower in self._followers], bool)] = -1
        self._put_away(np.flatnonzero((self._active >= 0) & (self._active != wanted)))
        self._activate(wanted)
        self._tell(config.edge_filter)

    def apply_meshes(self, batches: list[PatchBatch], supports: Any, config: PatchConfig) -> None:
        """Gives followers the mesh colliders of their patches."""
        for batch in batches:
            if batch.kind in MESH_KINDS:
                rows = [row for row, body in enumerate(batch.bodies.tolist()) if self._followers[body].solid]
                self.meshes.apply_batch(batch, rows, supports, self._followers, config)

    def release_meshes(self, batches: list[PatchBatch]) -> None:
        """Takes mesh colliders away from followers that have no such patch among ``batches``."""
        if self.meshes.count:
            served = {body for batch in batches if batch.kind in MESH_KINDS for body in batch.bodies.tolist()}
            for index, follower in enumerate(self._followers):
                if index not in served:
                    self.meshes.release(follower)

    def release(self, index: int) -> None:
        """Takes a follower's colliders away."""
        self._give_back(index, self._planes)
        self._give_back(index, self._fields)
        self.meshes.release(self._followers[index])
        self._followers[index].collider = None

    def _plan(
        self, grid: MovingGrid, chosen: IntArray, supports: Any, shapes: Any, samples: FloatArray, time: float,
        limits: Limits,
    ) -> None:  # fmt: skip
        """Plans for followers, after giving them colliders that fit."""
        todo = chosen
        for _ in range(2):
            plan(
                grid, todo, supports, shapes, self.table, self._planes, self._fields, samples, time, limits,
                self._heights, self._at_contact, self._work, self._poses, self._velocities, self._changes,
            )  # fmt: skip
            todo = todo[self._changes[todo] == MISFIT]
            if not todo.size:
                return
            for index in todo.tolist():
                if supports["state"][index] == Support.PLANE:
                    self._fit_box(index, float(plane_need(supports[index], shapes[index])), time)
                else:
                    self._fit_field(index, supports[index], grid.resolution, time)

    def _fit_box(self, index: int, need: float, time: float) -> None:
        """Gives a follower a box with room for it."""
        self._give_back(index, self._planes)
        size = box_size(need)
        free = self._free[(size,)]
        if not free:
            if size not in self._boxes:
                self._boxes[size] = make_box(self._client, size)
            free.append(self._new(self._boxes[size], -1))
            self.table["extent"][-1] = size
        self._hand_out(index, free.pop(), self._planes, time)

    def _fit_field(self, index: int, support: Any, resolution: float, time: float) -> None:
        """Gives a follower a field of another size."""
        self._give_back(index, self._fields)
        rows, columns, spacing = int(support.rows), int(support.columns), resolution * int(support.stride)
        bound = field_bound(rows, columns, spacing)
        free = self._free[rows, columns, spacing, bound]
        if not free:
            if self._visual is None:
                # With none given PyBullet makes a picture of the whole field, of some MiB each.
                self._visual = self._client.createVisualShape(pb.GEOM_BOX, halfExtents=[1e-3] * 3)
            free.append(self._new(make_field(self._client, rows, columns, spacing, bound), self._visual))
            record = self.table[-1]
            record.rows, record.columns, record.spacing, record.extent = rows, columns, spacing, bound
            record.first = len(self._heights)
            self._heights = np.concatenate([self._heights, np.full(rows * columns, np.nan)])
            self._at_contact = np.concatenate([self._at_contact, np.full(rows * columns, np.inf)])
        self._hand_out(index, free.pop(), self._fields, time)

    def _new(self, shape: int, visual: int) -> int:
        """Makes a collider; its place in the table. It is a multibody, because the contacts of a fixed rigid body do not
        see its velocity."""
        place = len(self.table)
        uid = self._client.createMultiBody(0.0, shape, visual, basePosition=self._park(place))
        # PyBullet multiplies the two coefficients of a contact: the body's alone decide.
        self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        self._pairs.claim(uid)
        table = np.zeros(place + 1, COLLIDER).view(np.recarray)
        table[:place] = self.table
        self.table = table
        record = table[place]
        record.uid, record.form, record.nz = uid, shape, 1.0
        return place

    def _hand_out(self, index: int, place: int, holders: IntArray, time: float) -> None:
        follower, record = self._followers[index], self.table[place]
        record.there, record.time = 0, time
        first, count = self._samples_of(place)
        self._at_contact[first : first + count] = np.inf
        self._pairs.join(int(record.uid), follower.body, follower.link)
        holders[index] = place

    def _give_back(self, index: int, holders: IntArray) -> None:
        """Parks a collider that a follower no longer needs."""
        place = int(holders[index])
        if place < 0:
            return
        holders[index] = -1
        follower, record = self._followers[index], self.table[place]
        if self._active[index] == place:
            self._put_away(np.array([index]))
        self._pairs.part(int(record.uid), follower.body, follower.link)
        key = (
            (float(record.extent),)
            if not record.rows
            else (int(record.rows), int(record.columns), float(record.spacing), float(record.extent))
        )
        self._free[key].append(place)

    def _put_away(self, followers: IntArray) -> None:
        """Has the colliders of followers wait far away."""
        for index in followers.tolist():
            place = int(self._active[index])
            record = self.table[place]
            pb.resetBasePositionAndOrientation(int(record.uid), self._park(place), UPRIGHT, self._client_id)
            pb.resetBaseVelocity(int(record.uid), STILL, STILL, self._client_id)
            for name in ("there", "vx", "vy", "vz", "wx", "wy", "wz"):
                record[name] = 0
            self._active[index] = -1
            self._followers[index].collider = None

    def _activate(self, wanted: IntArray) -> None:
        """Notes which colliders followers have now."""
        for index in np.flatnonzero(self._active != wanted).tolist():
            self._active[index] = wanted[index]
            self._followers[index].collider = int(self.table["uid"][wanted[index]])

    def _tell(self, edge_filter: bool) -> None:
        """Tells PyBullet what has changed, samples before poses before velocities."""
        changed = np.flatnonzero(self._changes)
        if not changed.size:
            return
        changes, places = self._changes[changed].tolist(), self._active[changed]
        uids = self.table["uid"][places].tolist()
        poses, velocities = self._poses[changed].tolist(), self._velocities[changed].tolist()
        place_of, client = places.tolist(), self._client_id
        set_pose, set_velocity = pb.resetBasePositionAndOrientation, pb.resetBaseVelocity
        for row, (index, change) in enumerate(zip(changed.tolist(), changes, strict=True)):
            if change & SAMPLES:
                self._replace(place_of[row], edge_filter and not self._followers[index].ball)
            if change & POSE:
                pose = poses[row]
                set_pose(uids[row], pose[:3], pose[3:], client)
            if change & VELOCITY:
                velocity = velocities[row]
                set_velocity(uids[row], velocity[:3], velocity[3:], client)

    def _replace(self, place: int, filtered: bool) -> None:
        """Gives a field its heights. The filter's flag is passed each time; without it PyBullet drops the edges' data."""
        self.replacements += 1
        record = self.table[place]
        first, count = self._samples_of(place)
        heights = self._heights[first : first + count].tolist()
        if record.turned:
            heights.reverse()
        self._calls.replace_heightfield(int(record.form), int(record.rows), int(record.columns), heights, filtered)

    def _samples_of(self, place: int) -> tuple[int, int]:
        """Where the heights of a field are, and how many."""
        record = self.table[place]
        return int(record.first), int(record.rows * record.columns)

    @staticmethod
    def _park(place: int) -> tuple[float, float, float]:
        return place * PARK_STEP, 0.0, PARK_DEPTH
