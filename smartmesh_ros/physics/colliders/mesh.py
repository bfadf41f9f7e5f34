"""Mesh colliders of followers: the report's trimesh, its convex hull with depth, and one convex prism per triangle.

PyBullet cannot change such a shape, so it is rebuilt whenever its vertices move, and PyBullet leaks 5 to 15 KiB per
rebuild. Use these kinds for comparisons and general meshes, not for hours of deforming terrain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import NDArray

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import SELECTION, MeshKind, PatchConfig, is_mesh
from smartmesh_ros.physics.colliders.pairs import Pairs
from smartmesh_ros.physics.followers import Follower, Followers
from smartmesh_ros.terrain.grid import FloatArray

# Depth below the nearest vertex of the hull's extra point (Figure 18), and of the prisms' lower faces [m].
BULK = 50.0
PRISM_DEPTH = 2.0
# Smallest motion of a vertex that rebuilds a collider [m].
SAME_PLACE = 1e-6


@dataclass(eq=False)
class _MeshCollider:
    kind: MeshKind
    edge_filter: bool
    uid: int
    vertices: FloatArray
    triangles: NDArray[np.int32]
    base: FloatArray  # position at the last motion that counted as a change (3,) [m]


class MeshColliders:
    """The mesh colliders under followers."""

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self.built = 0
        self._client = client
        self._pairs = pairs
        self._colliders: dict[Follower, _MeshCollider] = {}
        self.changed: list[int] = []  # slots of followers whose collider was rebuilt, moved or removed

    def apply_batch(
        self, batch: PatchBatch, rows: list[int], supports: Any, followers: Followers, config: PatchConfig
    ) -> None:
        """Update the colliders of the bodies in ``rows`` of a batch, including the ground's velocity; a patch of holes
        gets no collider."""
        assert is_mesh(batch.kind)
        for row in rows:
            index = int(batch.bodies[row])
            support, vertices, triangles = supports[index], batch.vertices_w[row], batch.triangles
            if batch.may_have_holes:
                triangles = triangles[~np.isnan(vertices[:, 2])[triangles].any(axis=1)]
            if not len(triangles):
                self.release(followers[index])
                continue
            base = batch.centres_w[row].copy()
            base[2] = support.foot_z
            surface = np.nan_to_num(vertices, nan=float(base[2]))
            built = self.built
            collider = self._collider(followers[index], batch.kind, surface - base, triangles, base, config.edge_filter)
            uid, limit = collider.uid, SELECTION.collider_slack * config.tolerance
            if self.built != built or np.abs(base - collider.base).max() > limit:
                collider.base = base
                self.changed.append(index)
            self._client.resetBasePositionAndOrientation(uid, base.tolist(), (0.0, 0.0, 0.0, 1.0))
            if config.carry_velocity:
                away = base - (support.foot_x, support.foot_y, support.foot_z)
                turn = np.array([support.turn_x, support.turn_y, support.turn_z])
                linear = np.array([support.slide_x, support.slide_y, support.rise]) + np.cross(turn, away)
                self._client.resetBaseVelocity(uid, linear.tolist(), turn.tolist())

    def _collider(
        self, follower: Follower, kind: MeshKind, relative: FloatArray, triangles: NDArray[np.int32], base: FloatArray,
        edge_filter: bool,
    ) -> _MeshCollider:  # fmt: skip
        """A follower's collider, built anew if its surface is another."""
        old = self._colliders.get(follower)
        if old is None or not _same(old, kind, edge_filter, relative, triangles):
            self.release(follower)
            uid = self._build(kind, relative, triangles, base, edge_filter)
            old = self._colliders[follower] = _MeshCollider(kind, edge_filter, uid, relative, triangles, base)
            follower.collider = uid
            self._pairs.join(uid, follower.body, follower.link)
            self.built += 1
        return old

    @property
    def count(self) -> int:
        """Number of mesh colliders."""
        return len(self._colliders)

    def release(self, follower: Follower) -> bool:
        """Remove a follower's mesh collider; returns False if it has none."""
        collider = self._colliders.pop(follower, None)
        if collider is None:
            return False
        self._pairs.retire(collider.uid)
        self._client.removeBody(collider.uid)
        follower.collider = None
        return True

    def _build(
        self, kind: MeshKind, relative: FloatArray, triangles: NDArray[np.int32], base: FloatArray, edge_filter: bool
    ) -> int:
        client = self._client
        if kind == "prisms":
            uid = self._build_prisms(relative[triangles], base)
        else:
            if kind == "hull":
                points = [*relative[np.unique(triangles)].tolist(), [0.0, 0.0, -BULK]]
                shape = client.createCollisionShape(pb.GEOM_MESH, vertices=points)
            else:
                flags = pb.GEOM_FORCE_CONCAVE_TRIMESH | (pb.GEOM_CONCAVE_INTERNAL_EDGE if edge_filter else 0)
                shape = client.createCollisionShape(
                    pb.GEOM_MESH, vertices=relative.tolist(), indices=triangles.ravel().tolist(), flags=flags
                )
            uid = client.createMultiBody(0.0, shape, basePosition=base.tolist())
        self._pairs.claim(uid)
        for link in range(-1, client.getNumJoints(uid)):
            client.changeDynamics(uid, link, lateralFriction=1.0, restitution=1.0)
        return int(uid)

    def _build_prisms(self, corners: FloatArray, base: FloatArray) -> int:
        """Create one body with a fixed link per triangle (T, 3, 3): its convex prism down to a common depth."""
        client = self._client
        shapes = []
        for triangle in corners:
            lower = triangle - (0.0, 0.0, PRISM_DEPTH)
            shapes.append(client.createCollisionShape(pb.GEOM_MESH, vertices=[*triangle.tolist(), *lower.tolist()]))
        count = len(shapes)
        zeros, unturned = [[0.0, 0.0, 0.0]] * count, [[0.0, 0.0, 0.0, 1.0]] * count
        return int(
            client.createMultiBody(
                0.0,
                -1,
                basePosition=base.tolist(),
                linkMasses=[0.0] * count,
                linkCollisionShapeIndices=shapes,
                linkVisualShapeIndices=[-1] * count,
                linkPositions=zeros,
                linkOrientations=unturned,
                linkInertialFramePositions=zeros,
                linkInertialFrameOrientations=unturned,
                linkParentIndices=[0] * count,
                linkJointTypes=[pb.JOINT_FIXED] * count,
                linkJointAxis=[[0.0, 0.0, 1.0]] * count,
            )
        )


def _same(
    old: _MeshCollider, kind: MeshKind, edge_filter: bool, vertices: FloatArray, triangles: NDArray[np.int32]
) -> bool:
    return (
        old.kind == kind
        and old.edge_filter == edge_filter
        and old.triangles.shape == triangles.shape
        and old.vertices.shape == vertices.shape
        and bool((np.abs(old.vertices - vertices) <= SAME_PLACE).all())
        and bool((old.triangles == triangles).all())
    )
