"""Colliders of PyBullet's own under followers, where contacts do not come from the map: one for each patch, replaced
as ground and body move, and moved with the ground's velocity between updates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.ground.colliders.field import Field, make_field
from smartmesh_ros.ground.colliders.mesh import MeshCollider, make_mesh
from smartmesh_ros.ground.colliders.pairs import Pairs
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.undone import undone
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import is_mesh
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import Terrain


class Colliders:
    """The colliders under followers. ``replacements``: how often a surface was changed so far. ``built``: meshes that
    were built so far, each of which PyBullet leaks."""

    def __init__(self, client: Any, followers: Followers, terrain: Terrain) -> None:
        self.replacements = 0
        self.built = 0
        self._client = client
        self._followers = followers
        self._terrain = terrain
        self._pairs = Pairs(client)
        self._held: dict[Follower, Field | MeshCollider] = {}

    def apply(self, batches: list[PatchBatch], supports: Any, *, carry: bool) -> None:
        """Give the awake followers that are solid the colliders of their patches, and take the colliders of those
        without a patch. ``carry``: move the colliders with the ground."""
        solid, served = set(self._followers.solid.tolist()), set()
        for batch in batches:
            feet = np.column_stack([supports[name][batch.bodies] for name in ("foot_x", "foot_y")])
            friction = self._terrain.friction_at(feet).tolist()
            for row, slot in enumerate(batch.bodies.tolist()):
                if slot in solid and batch.kind != "whole":
                    self._apply_patch(self._followers[slot], batch, row, supports[slot], carry=carry)
                    self._set_friction(self._followers[slot], friction[row])
                    served.add(slot)
        for slot in solid - served:
            self.release(self._followers[slot])

    def release(self, follower: Follower) -> None:
        """Remove a follower's collider."""
        if follower in self._held:
            self._drop(self._held[follower].uid)
            del self._held[follower]
            follower.collider = None

    def _drop(self, uid: int) -> None:
        self._pairs.retire(uid)
        self._client.removeBody(uid)

    def _apply_patch(self, follower: Follower, batch: PatchBatch, row: int, support: Any, *, carry: bool) -> None:
        vertices = batch.vertices_w[row]
        if is_mesh(batch.kind):
            base = np.array([*batch.centres_w[row, :2], support.foot_z])
            triangles = batch.triangles
            if batch.may_have_holes:
                triangles = triangles[~np.isnan(vertices[:, 2])[triangles].any(axis=1)]
            if not len(triangles):
                self.release(follower)
                return
            surface = np.nan_to_num(vertices, nan=float(base[2])) - base
            held = self._held.get(follower)
            if not (isinstance(held, MeshCollider) and held.fits(batch.kind, surface, triangles)):
                self._hold(follower, make_mesh(self._client, batch.kind, surface, triangles))
                self.built += 1
            turn = (0.0, 0.0, 0.0, 1.0)
        else:
            base = np.array([*(0.5 * (vertices[0, :2] + vertices[-1, :2])), batch.centres_w[row, 2]])
            turn = self._apply_field(follower, vertices, base, support)
        uid = follower.collider = self._held[follower].uid
        self._client.resetBasePositionAndOrientation(uid, base.tolist(), turn)
        if carry:
            self._push(uid, base, support)

    def _apply_field(
        self, follower: Follower, vertices: FloatArray, base: FloatArray, support: Any
    ) -> tuple[float, float, float, float]:
        """Give a follower the field of a patch's vertices (K, 3) [m]; returns its orientation (x, y, z, w)."""
        rows, columns = int(support.rows), int(support.columns)
        x, y = (vertices[1, :2] - vertices[0, :2]).tolist()
        spacing = math.hypot(x, y)
        held = self._held.get(follower)
        if not (isinstance(held, Field) and held.fits(rows, columns, spacing)):
            held = make_field(self._client, rows, columns, spacing)
            self._hold(follower, held)
        if held.replace(self._client, vertices[:, 2].reshape(rows, columns) - base[2]):
            self.replacements += 1
        half = 0.5 * (math.atan2(y, x) + 0.5 * math.pi)  # see `in_order`
        return 0.0, 0.0, math.sin(half), math.cos(half)

    def _push(self, uid: int, base: FloatArray, support: Any) -> None:
        """Move a collider with the ground under its follower."""
        away = base - (support.foot_x, support.foot_y, support.foot_z)
        turn = np.array([support.turn_x, support.turn_y, support.turn_z])
        linear = np.array([support.slide_x, support.slide_y, support.rise]) + np.cross(turn, away)
        self._client.resetBaseVelocity(uid, linear.tolist(), turn.tolist())

    def _set_friction(self, follower: Follower, friction: float) -> None:
        """Give a follower's collider a coefficient, by which PyBullet multiplies that of the body."""
        held = self._held.get(follower)
        if held is not None and held.friction != friction:
            for link in range(-1, self._client.getNumJoints(held.uid)):
                self._client.changeDynamics(held.uid, link, lateralFriction=friction)
            held.friction = friction

    def _hold(self, follower: Follower, made: Field | MeshCollider) -> None:
        """Put a new collider in the place of a follower's old one; it touches this follower alone."""
        with undone(lambda: self._drop(made.uid)):
            self.release(follower)
            self._pairs.claim(made.uid)
            for link in range(-1, self._client.getNumJoints(made.uid)):
                # PyBullet multiplies the coefficients of the two bodies, so 1 leaves the body's own in effect.
                self._client.changeDynamics(made.uid, link, lateralFriction=1.0, restitution=1.0)
            self._pairs.join(made.uid, follower.body, follower.link)
        self._held[follower] = made
