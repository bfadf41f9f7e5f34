"""Contacts with colliders of PyBullet's own: one for each patch, replaced as ground and body move, and moved with the
ground's velocity between refreshes."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import NDArray

from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.height_field import quarter_turn
from smartmesh_ros.ground.map_contacts import MapContacts
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.surface_query import checked_points, ground_samples
from smartmesh_ros.terrain.terrain import Terrain
from studies.report.batch import PatchBatch
from studies.report.config import MeshKind, ReportConfig, is_whole
from studies.report.made import Field, MeshCollider, make_field, make_mesh
from studies.report.patches import ChosenPatches
from studies.report.whole_mesh import WholeMesh


class Pairs:
    """Rules for which colliders touch which bodies in one PyBullet world.

    PyBullet keeps the rule of a pair of ids for ever, even after a body is removed and a new one gets its id. An id of
    a collider may go to a body, and an id of a body to a collider. The rules are recorded under both ids and reset, so
    that no pair inherits the rule of an earlier one. A body that touched another body's collider from below would be
    thrown.
    """

    def __init__(self, client: Any) -> None:
        self._client: int = getattr(client, "_client", 0)
        self._colliders: set[int] = set()  # claimed and not retired
        # By id, of bodies and colliders: its link, the other id, and the other's link.
        self._rules: dict[int, set[tuple[int, int, int]]] = defaultdict(set)

    def has(self, body: int) -> bool:
        """Return True if a PyBullet body is a collider."""
        return body in self._colliders

    def claim(self, collider: int) -> None:
        """Make a new collider touch nothing, and reset the rules of removed bodies and colliders with the same id."""
        for link in range(-1, pb.getNumJoints(collider, self._client)):
            # PyBullet lets two bodies touch if either mask contains the other's group, so the group must be empty, too.
            pb.setCollisionFilterGroupMask(collider, link, 0, 0, self._client)
        self._colliders.add(collider)
        self._reset(collider)

    def join(self, collider: int, body: int, link: int) -> None:
        """Makes a collider touch one body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            self._rules[collider].add((part, body, link))
            self._rules[body].add((link, collider, part))
            pb.setCollisionFilterPair(collider, body, part, link, 1, self._client)

    def part(self, collider: int, body: int, link: int) -> None:
        """Stop a collider from touching a body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            pb.setCollisionFilterPair(collider, body, part, link, 0, self._client)

    def retire(self, collider: int) -> None:
        """Reset a collider's rules before the collider is removed, so that a body that gets its id touches other bodies
        normally, and no collider."""
        self._colliders.discard(collider)
        self._reset(collider)

    def _reset(self, uid: int) -> None:
        """Let a body or collider touch whatever it had a rule with, unless one of the two is a collider."""
        for link, other, other_link in self._rules.get(uid, ()):
            touch = int(self._colliders.isdisjoint((uid, other)))
            pb.setCollisionFilterPair(uid, other, link, other_link, touch, self._client)


class PatchContacts(MapContacts):
    """Contacts of the followers in one client with the colliders of their patches, or with one of the whole terrain, in
    place of the map's.

    ``replacements``: how often a surface was changed so far. ``leaked``: meshes that were built so far, for each of
    which PyBullet leaks a few KiB.
    """

    def __init__(
        self, client: Any, followers: Followers, terrain: Terrain, config: ReportConfig, patches: ChosenPatches
    ) -> None:
        super().__init__(client, followers, terrain)
        self.replacements = self.leaked = 0
        self._config, self._patches = config, patches
        self._pairs = Pairs(client)
        self._held: dict[Follower, Field | MeshCollider] = {}
        self._whole = WholeMesh(client, config.kind) if is_whole(config.kind) else None

    def attach(self, follower: Follower) -> None:
        """The core only reads and moves a follower, which gets its collider in the next `refresh`."""
        self._core.attach(follower.slot, follower.body, follower.link, -1)
        self._core.set_shapes(self._followers.shape_table.core)
        self.note_kind(follower.slot)

    def note_kind(self, slot: int) -> None:
        """Tell the core who moves a follower, which only a guard lifts."""
        self._followers.table["own"][slot] &= self._config.guard
        super().note_kind(slot)

    def detach(self, slots: list[int]) -> None:
        """Remove the colliders of followers. If PyBullet fails, the next `refresh` makes those that are missing."""
        for slot in slots:
            self._release(self._followers[slot])
            self._patches.clear(slot)
        super().detach(slots)

    def let_sleep(self, config: SleepConfig | None) -> None:
        """Nobody sleeps on colliders."""

    def refresh(self) -> None:
        """Set the colliders to the patches of the followers, or the collider of the whole mesh to the ground."""
        if self._whole is not None:
            self._whole.update(next(iter(self._terrain.tiles.values())), self.time)
            return
        served = set()
        for batch in self._patches.batches:
            found = ground_samples(self._terrain, checked_points(batch.feet_w[:, :2]), self.time)
            friction = np.nan_to_num(found.friction, nan=1.0).tolist()
            for row, slot in enumerate(batch.slots.tolist()):
                self._apply(self._followers[slot], batch, row)
                self._set_friction(self._followers[slot], friction[row])
                served.add(slot)
        for slot in set(self._followers.solid.tolist()) - served:
            self._release(self._followers[slot])

    def is_ground(self, body: int) -> bool:
        """Return True if a PyBullet body is a collider of this ground."""
        return self._pairs.has(body) or (self._whole is not None and self._whole.has(body))

    def close(self) -> None:
        """Remove all colliders."""
        for follower in self._followers:
            self._release(follower)
        if self._whole is not None:
            self._whole.release()
        super().close()

    def _release(self, follower: Follower) -> None:
        """Remove a follower's collider."""
        if follower in self._held:
            self._drop(self._held[follower].uid)
            del self._held[follower]
            follower.collider = None

    def _drop(self, uid: int) -> None:
        self._pairs.retire(uid)
        self._client.removeBody(uid)

    def _apply(self, follower: Follower, batch: PatchBatch, row: int) -> None:
        """Give a follower the collider of its patch, the ``row`` of a batch."""
        vertices, foot = batch.vertices_w[row], batch.feet_w[row]
        kind: Any = "trimesh" if self._config.kind == "heightfield" else self._config.kind
        if self._config.kind == "heightfield" and batch.shape[0]:
            base = np.array([*(0.5 * (vertices[0, :2] + vertices[-1, :2])), batch.centres_w[row, 2]])
            turn = self._apply_field(follower, vertices, base, batch.shape)
        else:
            base, turn = np.array([*batch.centres_w[row, :2], foot[2]]), (0.0, 0.0, 0.0, 1.0)
            triangles = batch.triangles[~np.isnan(vertices[:, 2])[batch.triangles].any(axis=1)]
            if not len(triangles):
                self._release(follower)
                return
            self._apply_mesh(follower, kind, np.nan_to_num(vertices, nan=float(base[2])) - base, triangles)
        uid = follower.collider = self._held[follower].uid
        self._client.resetBasePositionAndOrientation(uid, base.tolist(), turn)
        if self._config.carry_velocity:
            angular = batch.angular_w[row]
            linear = batch.linear_w[row] + np.cross(angular, base - foot)
            self._client.resetBaseVelocity(uid, linear.tolist(), angular.tolist())

    def _apply_mesh(
        self, follower: Follower, kind: MeshKind, surface: FloatArray, triangles: NDArray[np.int32]
    ) -> None:
        """Give a follower a collider of ``triangles`` (T, 3) among vertices (K, 3) relative to its base [m]."""
        held = self._held.get(follower)
        if not (isinstance(held, MeshCollider) and held.fits(kind, surface, triangles)):
            self._hold(follower, make_mesh(self._client, kind, surface, triangles))
            self.leaked += 1
            self.replacements += 1

    def _apply_field(
        self, follower: Follower, vertices: FloatArray, base: FloatArray, shape: tuple[int, int]
    ) -> tuple[float, float, float, float]:
        """Give a follower the field of a patch's vertices (K, 3) [m]; returns its orientation (x, y, z, w)."""
        x, y = (vertices[1, :2] - vertices[0, :2]).tolist()
        spacing = math.hypot(x, y)
        held = self._held.get(follower)
        if not (isinstance(held, Field) and held.fits(*shape, spacing)):
            held = make_field(self._client, *shape, spacing)
            self._hold(follower, held)
        if held.replace(self._client, vertices[:, 2].reshape(shape) - base[2]):
            self.replacements += 1
        return quarter_turn(math.atan2(y, x))

    def _set_friction(self, follower: Follower, friction: float) -> None:
        """Give a follower's collider a coefficient, by which PyBullet multiplies that of the body."""
        held = self._held.get(follower)
        if held is not None and held.friction != friction:
            for link in range(-1, self._client.getNumJoints(held.uid)):
                self._client.changeDynamics(held.uid, link, lateralFriction=friction)
            held.friction = friction

    def _hold(self, follower: Follower, made: Field | MeshCollider) -> None:
        """Put a new collider in the place of a follower's old one; it touches this follower alone."""
        self._release(follower)
        self._pairs.claim(made.uid)
        for link in range(-1, self._client.getNumJoints(made.uid)):
            # PyBullet multiplies the coefficients of the two bodies, so 1 leaves the body's own in effect.
            self._client.changeDynamics(made.uid, link, lateralFriction=1.0, restitution=1.0)
        self._pairs.join(made.uid, follower.body, follower.link)
        self._held[follower] = made
