"""Contacts with colliders of PyBullet's own: one for each patch, replaced as ground and body move, and moved with the
ground's velocity between refreshes."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np

from smartmesh_ros import Terrain
from smartmesh_ros.ground.config import SleepConfig
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.map_contacts import MapContacts
from smartmesh_ros.ground.shown_ground import quarter_turn
from studies.report.config import ReportConfig
from studies.report.made import Field, MeshCollider, WholeMesh, make_field, make_mesh
from studies.report.patches import ChosenPatches, PatchBatch

Collider = TypeVar("Collider", Field, MeshCollider)


class PatchContacts(MapContacts):
    """Contacts of the followers in one client with the colliders of their patches, or with one of the whole terrain, in
    place of the map's."""

    def __init__(
        self, client: Any, followers: Followers, terrain: Terrain, config: ReportConfig, patches: ChosenPatches
    ) -> None:
        super().__init__(client, followers, terrain)
        self._terrain, self._config, self._patches = terrain, config, patches
        self._held: dict[Follower, Field | MeshCollider] = {}
        # By id of a collider, also of one that was removed: its links, each with the body and link that it touches.
        self._pairs: dict[int, list[tuple[int, int, int]]] = {}
        self._whole = WholeMesh(client, config.kind) if config.whole else None

    def attach(self, follower: Follower) -> None:
        """The core only reads and moves a follower, which gets its collider in the next `refresh`."""
        self.core.attach(follower.slot, follower.body, follower.link, -1, follower.shape)
        self.note_kind(follower)

    def note_kind(self, follower: Follower) -> None:
        """Tell the core who moves a follower, which only a guard lifts."""
        follower.own &= self._config.guard
        super().note_kind(follower)

    def detach(self, slots: list[int]) -> None:
        """Remove the colliders of followers. If PyBullet fails, the next `refresh` makes those that are missing."""
        for slot in slots:
            self._release(self._followers[slot])
        super().detach(slots)

    def let_sleep(self, config: SleepConfig | None) -> None:
        """Nobody sleeps on colliders."""

    def refresh(self) -> None:
        """Set the colliders to the patches of the followers, or the collider of the whole mesh to the ground."""
        if self._whole is not None:
            self._whole.update(next(iter(self._terrain.tiles.values())), self.core.time)
            return
        served = set()
        for batch in self._patches.batches:
            for row, follower in enumerate(self._followers[slot] for slot in batch.slots.tolist()):
                if follower.solid:
                    self._apply(follower, batch, row)
                    served.add(follower.slot)
        for follower in self._followers:
            if follower.solid and follower.slot not in served:
                self._release(follower)

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
            self._client.removeBody(self._held.pop(follower).uid)
            follower.collider = None

    def _apply(self, follower: Follower, batch: PatchBatch, row: int) -> None:
        """Give a follower the collider of its patch, the ``row`` of a batch."""
        client, held, turn = self._client, self._held.get(follower), (0.0, 0.0, 0.0, 1.0)
        vertices, foot = batch.vertices_w[row], batch.feet_w[row]
        if self._config.kind == "heightfield" and batch.shape[0]:
            base = np.array([*(0.5 * (vertices[0, :2] + vertices[-1, :2])), batch.centres_w[row, 2]])
            x, y = (vertices[1, :2] - vertices[0, :2]).tolist()
            layout, turn = (*batch.shape, math.hypot(x, y)), quarter_turn(math.atan2(y, x))
            if not (isinstance(held, Field) and held.fits(*layout)):
                held = self._hold(follower, make_field(client, *layout))
            held.replace(client, vertices[:, 2].reshape(batch.shape) - base[2])
        else:
            kind: Any = "trimesh" if self._config.kind == "heightfield" else self._config.kind
            base = np.array([*batch.centres_w[row, :2], foot[2]])
            triangles = batch.triangles[~np.isnan(vertices[:, 2])[batch.triangles].any(axis=1)]
            if not len(triangles):
                self._release(follower)
                return
            surface = np.nan_to_num(vertices, nan=float(base[2])) - base
            if not (isinstance(held, MeshCollider) and held.fits(surface, triangles)):
                held = self._hold(follower, make_mesh(client, kind, surface, triangles))
        uid = follower.collider = held.uid
        client.resetBasePositionAndOrientation(uid, base.tolist(), turn)
        if self._config.carry_velocity:
            angular = batch.angular_w[row]
            linear = batch.linear_w[row] + np.cross(angular, base - foot)
            client.resetBaseVelocity(uid, linear.tolist(), angular.tolist())

    def _hold(self, follower: Follower, made: Collider) -> Collider:
        """Put a new collider, which is returned, in the place of a follower's old one; it touches this follower alone.

        PyBullet keeps the rule of a pair of ids for ever, also for a collider that gets the id of an earlier one.
        """
        self._release(follower)
        client, uid = self._client, made.uid
        for link, body, its_link in self._pairs.get(uid, ()):
            client.setCollisionFilterPair(uid, body, link, its_link, 0)
        links = range(-1, client.getNumJoints(uid))
        for link in links:
            # PyBullet lets two bodies touch if either mask contains the other's group, so the group must be empty, too.
            client.setCollisionFilterGroupMask(uid, link, 0, 0)
            client.setCollisionFilterPair(uid, follower.body, link, follower.link, 1)
            # PyBullet multiplies the coefficients of the two bodies, so 1 leaves the body's own in effect.
            client.changeDynamics(uid, link, lateralFriction=1.0, restitution=1.0)
        self._pairs[uid] = [(link, follower.body, follower.link) for link in links]
        self._held[follower] = made
        return made
