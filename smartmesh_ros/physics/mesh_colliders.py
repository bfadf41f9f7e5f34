"""Colliders of followers as meshes: the report's trimesh, its bulky convex hull, and one convex prism per triangle.

PyBullet cannot change such a shape, so each is built anew when its vertices have moved, and PyBullet keeps 5 to 15 KiB
of every one that was removed: they are for comparison, and for general meshes, not for hours of deforming terrain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pybullet as pb
from numpy.typing import NDArray

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.physics.pairs import Pairs
from smartmesh_ros.terrain.grid import FloatArray, IntArray

MeshKind = Literal["trimesh", "hull", "prisms"]

# How far below the nearest vertex the hull's extra point lies (Figure 18), and the prisms' lower faces [m].
BULK = 50.0
PRISM_DEPTH = 2.0
# Vertices that moved by less than this are where they were [m].
SAME_PLACE = 1e-6


@dataclass(eq=False)
class _MeshCollider:
    kind: MeshKind
    edge_filter: bool
    uid: int
    vertices: FloatArray
    triangles: NDArray[np.int32]


class MeshColliders:
    """The mesh colliders under followers."""

    def __init__(self, client: Any, pairs: Pairs) -> None:
        self.built = 0
        self._client = client
        self._pairs = pairs
        self._colliders: dict[Follower, _MeshCollider] = {}

    def apply_batch(
        self,
        batch: PatchBatch,
        rows: IntArray,
        base: FloatArray,
        higher: FloatArray,
        twist: FloatArray | None,
        followers: list[Follower],
        *,
        edge_filter: bool,
    ) -> None:
        """Gives ``followers``, as the batch's bodies count them, in ``rows`` of a batch their colliders, on bodies at
        ``base`` (n, 3) [m] that carry the ground's ``twist`` (n, 6), None = at rest, and are ``higher`` (n,) [m] than
        the batch says; none where all is holes."""
        assert batch.kind == "trimesh" or batch.kind == "hull" or batch.kind == "prisms"
        vertices = batch.vertices_w()
        for row in rows.tolist():
            follower, triangles = followers[int(batch.bodies[row])], batch.triangles
            if batch.may_have_holes:
                triangles = triangles[~np.isnan(vertices[row, :, 2])[triangles].any(axis=1)]
            if not len(triangles):
                self.release(follower)
                continue
            surface = np.nan_to_num(vertices[row], nan=float(base[row, 2]))
            carried = None if twist is None else twist[row]
            self.apply(follower, batch.kind, surface, triangles, base[row], float(higher[row]), carried, edge_filter)

    def apply(
        self,
        follower: Follower,
        kind: MeshKind,
        vertices_w: FloatArray,
        triangles: NDArray[np.int32],
        base: FloatArray,
        higher: float,
        twist: FloatArray | None,
        edge_filter: bool,
    ) -> None:
        """Gives a follower its collider: a surface of ``vertices_w`` (K, 3) [m] and ``triangles`` (T, 3), on a body at
        ``base`` (3,) [m], ``higher`` [m] than that, that carries the ground's ``twist`` (6,), None = at rest."""
        relative = vertices_w - base
        old = self._colliders.get(follower)
        if old is None or not _same(old, kind, edge_filter, relative, triangles):
            self.release(follower)
            uid = self._build(kind, relative, triangles, base, edge_filter)
            old = self._colliders[follower] = _MeshCollider(kind, edge_filter, uid, relative, triangles)
            follower.collider = uid
            self._pairs.join(uid, follower.body, follower.link)
            self.built += 1
        x, y, z = base.tolist()
        self._client.resetBasePositionAndOrientation(old.uid, (x, y, z + higher), (0.0, 0.0, 0.0, 1.0))
        if twist is not None:
            self._client.resetBaseVelocity(old.uid, twist[:3].tolist(), twist[3:].tolist())

    def release(self, follower: Follower) -> None:
        """Takes a follower's mesh collider away, if it has one."""
        collider = self._colliders.pop(follower, None)
        if collider is not None:
            self._pairs.retire(collider.uid)
            self._client.removeBody(collider.uid)
            follower.collider = None

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
        """One body with a fixed link per triangle (T, 3, 3): its convex prism down to a common depth."""
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
