"""Patches as they are now: what colliders are made of and outputs show."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.patches.collect import CollectMethod
from smartmesh_ros.patches.config import ColliderKind
from smartmesh_ros.patches.grid_collect import Collected, collect_inside
from smartmesh_ros.patches.template import PatchTemplate
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import TriangleMesh


class SurfaceTwist(NamedTuple):
    """Velocity of the ground at n points and its turning, (n, 3) [m/s, rad/s]."""

    linear_w: FloatArray
    angular_w: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchBatch(ABC):
    """Patches of n bodies that share a tile and their triangles.

    ``kind``: their collider. ``bodies``: indices of the bodies (n,). ``triangles``: corners (T, 3) among the K vertices
    of a patch. ``rows``, ``columns``: nearest vertex (n,); on a general mesh row 0 and the vertex's index. ``stride``:
    samples of the map from one sample of the patch to the next (n,). ``centres_w``: position of the nearest
    vertex (n, 3) [m]. ``surface``: how the ground moves there, or what works that out once somebody asks for it.
    ``deviation``: how far the collider may lie from the main mesh where the body can touch it (n,) [m], NaN = unknown.
    """

    tile: str
    kind: ColliderKind
    bodies: IntArray
    triangles: NDArray[np.int32]
    rows: IntArray
    columns: IntArray
    stride: IntArray
    centres_w: FloatArray
    surface: SurfaceTwist | Callable[[], SurfaceTwist]
    deviation: FloatArray

    @cached_property
    def twist(self) -> SurfaceTwist:
        """How the ground moves at the centres."""
        return self.surface() if callable(self.surface) else self.surface

    @property
    def linear_w(self) -> FloatArray:
        """Velocity of the ground at the centres (n, 3) [m/s]."""
        return self.twist.linear_w

    @property
    def angular_w(self) -> FloatArray:
        """Turning of the ground there (n, 3) [rad/s]."""
        return self.twist.angular_w

    @abstractmethod
    def vertices_w(self) -> FloatArray:
        """Vertices of all patches (n, K, 3) [m]; z is NaN where there is no ground."""

    @property
    @abstractmethod
    def may_have_holes(self) -> bool:
        """Whether any vertex may be without ground."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GridBatch(PatchBatch):
    """Patches of a height map at ``time`` [s]. ``spacing``: distance of their samples (n,) [m].

    ``ground``: their samples, None = to be read once somebody asks for them, by ``method``. ``since`` (n,) [s]: from
    when on the ground has gone on with the velocity it had then, NaN = not known. ``points_w`` (n, 3) [m],
    ``normals_w`` (n, 3): a plane along the ground under each body, by its point nearest to the body and its upward
    normal; None where nobody worked it out.
    """

    heightmap: HeightMap
    template: PatchTemplate
    spacing: FloatArray
    time: float
    since: FloatArray
    method: CollectMethod = "cached"
    ground: Collected | None = None
    points_w: FloatArray | None = None
    normals_w: FloatArray | None = None

    def read(self, rows: IntArray | slice = slice(None), *, velocities: bool = False) -> Collected:
        """Samples of the patches in ``rows``."""
        if self.ground is None:
            cells = Cells(self.rows[rows], self.columns[rows])
            return collect_inside(
                self.heightmap, self.template, cells, self.stride[rows], self.time, self.method, velocities=velocities
            )
        speeds = self.ground.velocities
        return Collected(self.ground.heights[rows], None if speeds is None else speeds[rows], self.ground.holes)

    @cached_property
    def heights_w(self) -> FloatArray:
        """Heights of all samples (n, K) [m]."""
        return self.read().heights

    def vertices_w(self) -> FloatArray:
        """Vertices of all patches (n, K, 3) [m], in the order of the template."""
        return _grid_vertices(self.template, self.centres_w, self.stride, self.heightmap.geometry, self.heights_w)

    @property
    def may_have_holes(self) -> bool:
        """Whether any sample may be NaN."""
        return self.heightmap.has_holes if self.ground is None else self.ground.holes


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneBatch(PatchBatch):
    """Patches of a height map whose collider is the plane along the ground under the body.

    ``points_w`` (n, 3) [m], ``normals_w`` (n, 3): the plane, by its point nearest to the body when it was last looked
    at and its upward normal. ``since`` as in `GridBatch`. ``time`` [s] is what its vertices, 3 x 3 samples near to it,
    are read at: only once somebody asks for them.
    """

    heightmap: HeightMap
    template: PatchTemplate
    points_w: FloatArray
    normals_w: FloatArray
    since: FloatArray
    time: float

    def vertices_w(self) -> FloatArray:
        """Samples near the planes (n, 9, 3) [m], in the order of the template."""
        cells = Cells(self.rows, self.columns)
        ground = collect_inside(
            self.heightmap, self.template, cells, self.stride, self.time, "cached", velocities=False
        )
        return _grid_vertices(self.template, self.centres_w, self.stride, self.heightmap.geometry, ground.heights)

    @property
    def may_have_holes(self) -> bool:
        """A plane never lies over a hole."""
        return False


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshBatch(PatchBatch):
    """The patch of one body on a general mesh, n = 1.

    ``positions_w``: its vertices (1, K, 3) [m]; ``vertices``: their indices in the mesh (K,). ``points_w``: a point of
    the ground under the body (1, 3) [m].
    """

    mesh: TriangleMesh
    positions_w: FloatArray
    vertices: IntArray
    points_w: FloatArray

    def vertices_w(self) -> FloatArray:
        """Vertices (1, K, 3) [m]."""
        return self.positions_w

    @property
    def may_have_holes(self) -> bool:
        """A general mesh has no ground where it has no triangle."""
        return False


def _grid_vertices(
    template: PatchTemplate, centres_w: FloatArray, stride: IntArray, geometry: GridGeometry, heights_w: FloatArray
) -> FloatArray:
    """Vertices (n, K, 3) [m] of patches around samples at ``centres_w`` (n, 2+) [m], with the given heights (n, K)
    [m]."""
    apart = stride[:, None] * geometry.resolution
    vertices = np.empty((*heights_w.shape, 3))
    x, y = vertices[..., 0], vertices[..., 1]
    cos, sin = math.cos(geometry.yaw), math.sin(geometry.yaw)
    np.multiply(cos * template.columns - sin * template.rows, apart, out=x)
    np.multiply(sin * template.columns + cos * template.rows, apart, out=y)
    x += centres_w[:, :1]
    y += centres_w[:, 1:2]
    vertices[..., 2] = heights_w
    return vertices


def plane_twist(heightmap: HeightMap, rates: FloatArray) -> SurfaceTwist:
    """How planes move at the middles of their windows, from how their coefficients (height, slope along x, slope along
    y) change a second (n, 3).

    A point at (x, y) of a plane that turns with w rises at w_x y - w_y x, so the slope of the velocity is the turning.
    """
    linear, angular = np.zeros((2, len(rates), 3))
    linear[:, :2], linear[:, 2] = heightmap.slide_w, rates[:, 0]
    cos, sin = math.cos(heightmap.geometry.yaw), math.sin(heightmap.geometry.yaw)
    angular[:, 0] = rates[:, 1] * sin + rates[:, 2] * cos
    angular[:, 1] = rates[:, 2] * sin - rates[:, 1] * cos
    return SurfaceTwist(linear, angular)


def mesh_twist(
    offsets: FloatArray, velocities: FloatArray, body: FloatArray, edge: float
) -> tuple[FloatArray, FloatArray]:
    """Twist of the rigid motion nearest to the ``velocities`` (k, 3) of points at ``offsets`` (k, 3) from a centre.

    By least squares, weighted towards where the ``body`` is (3,) from that centre [m]: at a distance of one ``edge``
    [m] the weight is a seventh. The mean over a patch is another motion where the velocity is curved.
    """
    distance = np.einsum("ij,ij->i", offsets - body, offsets - body)
    weight = np.exp(-2.0 * (distance - distance.min()) / (edge * edge))[:, None]
    share = weight / weight.sum()
    middle, linear = (share * offsets).sum(axis=0), (share * velocities).sum(axis=0)
    arm, swing = offsets - middle, velocities - linear
    inertia = (share * arm * arm).sum() * np.eye(3) - (share * arm).T @ arm
    # A flat patch does not tell about turning in its own plane beyond what its points show; lstsq leaves that out.
    angular = np.linalg.lstsq(inertia, (share * np.cross(arm, swing)).sum(axis=0), rcond=1e-9)[0]
    return linear - np.cross(angular, middle), angular
