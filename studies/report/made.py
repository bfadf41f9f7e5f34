"""Colliders of PyBullet's own: heightfields of patches, replaced in place; and those of the report, a trimesh, its
convex hull with depth, and one convex prism per triangle.

PyBullet cannot change one of the latter, so it is rebuilt whenever its vertices move, and PyBullet leaks 5 to 15 KiB
per rebuild. Use these kinds for comparisons and general meshes, not for hours of deforming terrain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as pb
from numpy.typing import NDArray

from smartmesh_ros.ground.shown_ground import make_shape, quarter_turn, replace_heights
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.report.config import PatchKind

# Depth of holes below a field's base [m].
HOLE = 100.0
# Heights that differ by less count as equal [m].
SAME_HEIGHT = 1e-6
# Slope that a field's bounds allow, from its middle to its edges.
STEEPEST = 2.0


@dataclass(eq=False)
class Field:
    """A field of samples that are ``spacing`` [m] apart: its PyBullet ``shape``, ``uid`` of its body, and the
    ``heights`` above its base (rows, columns) [m]."""

    spacing: float
    shape: int
    uid: int
    heights: FloatArray

    def fits(self, rows: int, columns: int, spacing: float) -> bool:
        """Return True if the field has these sizes, which PyBullet cannot change."""
        return self.heights.shape == (rows, columns) and abs(self.spacing - spacing) <= 1e-9 * spacing

    def replace(self, client: Any, heights: FloatArray) -> None:
        """Replace the heights above the base (rows, columns) [m], unless they are the same already."""
        if not np.allclose(heights, self.heights, rtol=0.0, atol=SAME_HEIGHT, equal_nan=True):
            replace_heights(client, self.shape, np.where(np.isnan(heights), -HOLE, heights))
            self.heights = heights


def make_field(client: Any, rows: int, columns: int, spacing: float, bound: float | None = None) -> Field:
    """Create a field and its body; its heights may differ by ``bound`` [m] from its base, by default by what its size
    allows at `STEEPEST`. The body is a multibody, because contacts ignore the velocity of a fixed rigid body.

    A field's base lies at its middle sample, so a body on it is inside the bounds even if other ground is much higher
    or lower. Bounds of 200 m with a slight tilt would overlap those of many neighbouring bodies.
    """
    bound = bound or min(0.5 * STEEPEST * (max(rows, columns) - 1) * spacing, HOLE)
    shape = make_shape(client, rows, columns, spacing, bound)
    # Without a visual shape PyBullet creates one of the whole field, which takes a few MiB.
    visual = client.createVisualShape(pb.GEOM_BOX, halfExtents=[1e-3] * 3)
    uid = client.createMultiBody(0.0, shape, visual)
    return Field(spacing, shape, uid, np.full((rows, columns), np.inf))


# Depth below the nearest vertex of the hull's extra point (Figure 18), and of the prisms' lower faces [m].
BULK = 50.0
PRISM_DEPTH = 2.0
# Smallest motion of a vertex that rebuilds a collider [m].
SAME_PLACE = 1e-6


@dataclass(eq=False)
class MeshCollider:
    """A collider of ``triangles`` (T, 3) among ``vertices`` (K, 3) relative to its base [m], with its body ``uid``."""

    uid: int
    vertices: FloatArray
    triangles: NDArray[np.int32]

    def fits(self, vertices: FloatArray, triangles: NDArray[np.int32]) -> bool:
        """Return True if this is a collider of such a surface."""
        same = self.vertices.shape == vertices.shape and np.array_equal(self.triangles, triangles)
        return same and bool((np.abs(self.vertices - vertices) <= SAME_PLACE).all())


def make_mesh(client: Any, kind: PatchKind, vertices: FloatArray, triangles: NDArray[np.int32]) -> MeshCollider:
    """Create a collider and its body."""
    if kind == "prisms":
        uid = _make_prisms(client, vertices[triangles])
    else:
        if kind == "hull":
            points = [*vertices[np.unique(triangles)].tolist(), [0.0, 0.0, -BULK]]
            shape = client.createCollisionShape(pb.GEOM_MESH, vertices=points)
        else:
            shape = client.createCollisionShape(
                pb.GEOM_MESH, vertices=vertices.tolist(), indices=triangles.ravel().tolist(),
                flags=pb.GEOM_FORCE_CONCAVE_TRIMESH,
            )  # fmt: skip
        uid = client.createMultiBody(0.0, shape)
    return MeshCollider(int(uid), vertices, triangles)


def _make_prisms(client: Any, corners: FloatArray) -> int:
    """Create one body with a fixed link per triangle (T, 3, 3): its convex prism down to a common depth."""
    shapes = []
    for triangle in corners:
        lower = triangle - (0.0, 0.0, PRISM_DEPTH)
        shapes.append(client.createCollisionShape(pb.GEOM_MESH, vertices=[*triangle.tolist(), *lower.tolist()]))
    count = len(shapes)
    zeros, unturned = [[0.0, 0.0, 0.0]] * count, [[0.0, 0.0, 0.0, 1.0]] * count
    uid = client.createMultiBody(
        0.0, -1, linkMasses=[0.0] * count, linkCollisionShapeIndices=shapes, linkVisualShapeIndices=[-1] * count,
        linkPositions=zeros, linkOrientations=unturned, linkInertialFramePositions=zeros,
        linkInertialFrameOrientations=unturned, linkParentIndices=[0] * count,
        linkJointTypes=[pb.JOINT_FIXED] * count, linkJointAxis=[[0.0, 0.0, 1.0]] * count,
    )  # fmt: skip
    return int(uid)


class WholeMesh:
    """Simple-Mesh: a collider of the whole height map, shared by every body of the world, the baseline that the report
    compares its patches with. Its size stays the same. It ignores the ground's velocity, and its cost grows with the
    map instead of the bodies."""

    def __init__(self, client: Any, kind: PatchKind) -> None:
        self._client, self._kind = client, kind
        self._made: Field | MeshCollider | None = None
        # The map and its version at the last update, and True if it moved.
        self._state: tuple[Any, int, bool] = (None, 0, True)

    def update(self, ground: Any, time: float) -> None:
        """Set the collider to a map at ``time`` [s]: a trimesh is rebuilt, a heightfield replaced in place."""
        state = ground, ground.version, ground.moving(time)
        if state == self._state and not state[2]:
            return
        if ground is not self._state[0] or self._kind == "whole_trimesh":
            self.release()
        client, made, geometry = self._client, self._made, ground.geometry
        shape = geometry.rows, geometry.columns
        heights = ground.sample(np.arange(geometry.size), time).heights
        if made is None:
            if self._kind == "whole_trimesh":
                places = geometry.to_world(*np.divmod(np.arange(geometry.size), geometry.columns))
                triangles = grid_triangles(*shape).astype(np.int32)
                made = make_mesh(client, "trimesh", np.column_stack([places, heights]), triangles)
            else:
                made = make_field(client, *shape, geometry.resolution, HOLE)
                middle = geometry.to_world(0.5 * (shape[0] - 1), 0.5 * (shape[1] - 1)).tolist()
                place = (*middle, geometry.origin[2])
                client.resetBasePositionAndOrientation(made.uid, place, quarter_turn(geometry.yaw))
            client.changeDynamics(made.uid, -1, lateralFriction=1.0, restitution=1.0)
        if isinstance(made, Field):
            made.replace(client, heights.reshape(shape) - geometry.origin[2])
        self._made, self._state = made, state

    def release(self) -> None:
        """Remove the collider."""
        if self._made is not None:
            self._client.removeBody(self._made.uid)
        self._made, self._state = None, (None, 0, True)
