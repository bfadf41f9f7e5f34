"""Patches for outputs and mesh colliders, computed from the supports on demand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.report.config import ColliderKind, ReportConfig
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap, Samples
from smartmesh_ros.terrain.motion import INSTANT
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.terrain.trimesh import grid_triangles


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchBatch:
    """Patches of n bodies that share a tile, a collider kind and their triangles.

    ``bodies``: indices of the bodies (n,). ``triangles``: corners (T, 3) as indices into the K vertices of a patch.
    ``rows``, ``columns``: the sample in the patch's middle (n,); on a general mesh row 0 and the nearest vertex.
    ``stride``: distance between neighbouring samples of the patch, in samples of the map (n,). ``vertices_w`` (n, K, 3)
    [m]; z is NaN at holes. ``centres_w``: the middle sample (n, 3) [m]. ``linear_w`` [m/s], ``angular_w`` [rad/s]:
    velocity and angular velocity of the ground at the middle sample (n, 3). ``deviation``: bound on the distance
    between the collider and the main mesh where the body can touch it (n,) [m], NaN = unknown.
    """

    tile: str
    kind: ColliderKind
    bodies: IntArray
    triangles: NDArray[np.int32]
    rows: IntArray
    columns: IntArray
    stride: IntArray
    deviation: FloatArray
    vertices_w: FloatArray
    centres_w: FloatArray
    linear_w: FloatArray
    angular_w: FloatArray
    vertices: IntArray | None = None  # on a general mesh: the patch's vertices as indices into the mesh (K,)

    @cached_property
    def may_have_holes(self) -> bool:
        """Return True if any vertex is a hole."""
        return bool(np.isnan(self.vertices_w[..., 2]).any())

    def of(self, members: IntArray) -> PatchBatch:
        """Return a batch of the patches ``members`` (m,) only."""
        names = ("bodies", "rows", "columns", "stride", "deviation", "vertices_w", "centres_w", "linear_w", "angular_w")
        return replace(self, **{name: getattr(self, name)[members] for name in names})


def rectangle_samples(supports: Any) -> tuple[IntArray, IntArray]:
    """Rows and columns (n, K) of the samples of n rectangles of equal size, on their map."""
    high, wide = int(supports["rows"][0]), int(supports["columns"][0])
    r, c = np.divmod(np.arange(high * wide), wide)
    stride = supports["stride"][:, None]
    return supports["row"][:, None] + r * stride, supports["column"][:, None] + c * stride


def grid_batches(
    terrain: Terrain,
    name: str,
    bodies: IntArray,
    supports: Any,
    time: float,
    config: ReportConfig,
) -> Iterator[PatchBatch]:
    """Yield the patches of ``bodies`` (n,) with ``supports`` (n,) on the height map ``name`` at ``time`` [s]."""
    heightmap = terrain.tiles[name]
    assert isinstance(heightmap, HeightMap)
    keys = np.stack([supports["rows"], supports["columns"]], axis=1)
    for key in np.unique(keys, axis=0):
        of_key = np.flatnonzero((keys == key).all(axis=1))
        chosen = supports[of_key]
        rows, columns = rectangle_samples(chosen)
        vertices = np.empty((*rows.shape, 3))
        vertices[..., :2] = heightmap.placed_at(time).to_world(rows, columns)
        vertices[..., 2] = samples_across(terrain, heightmap, rows, columns, time).heights
        high, wide = key.tolist()
        middle = (high - 1) // 2 * wide + (wide - 1) // 2
        centres = vertices[:, middle].copy()
        centres[:, 2] = np.where(np.isnan(centres[:, 2]), chosen["foot_z"], centres[:, 2])
        linear, angular = twists_at(chosen, centres)
        yield PatchBatch(
            tile=name, kind=config.grid_kind, bodies=bodies[of_key],
            triangles=grid_triangles(high, wide).astype(np.int32), rows=rows[:, middle], columns=columns[:, middle],
            stride=chosen["stride"].copy(), deviation=chosen["deviation"].copy(), vertices_w=vertices,
            centres_w=centres, linear_w=linear, angular_w=angular,
        )  # fmt: skip


def twists_at(supports: Any, points_w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Velocity [m/s] and angular velocity [rad/s] of the ground of supports (n,) at points (n, 3), (n, 3) each.

    Ground moves in vertical columns, so the result does not depend on a point's height above the foot.
    """
    linear, angular = np.zeros((2, len(supports), 3))
    away_x, away_y = points_w[:, 0] - supports["foot_x"], points_w[:, 1] - supports["foot_y"]
    linear[:, 0] = supports["slide_x"] - supports["turn_z"] * away_y
    linear[:, 1] = supports["slide_y"] + supports["turn_z"] * away_x
    linear[:, 2] = supports["rise"] + supports["turn_x"] * away_y - supports["turn_y"] * away_x
    for axis, name in enumerate(("turn_x", "turn_y", "turn_z")):
        angular[:, axis] = supports[name]
    return linear, angular


def samples_across(
    terrain: Terrain, heightmap: HeightMap, rows: IntArray, columns: IntArray, time: float, ahead: float = INSTANT
) -> Samples:
    """Samples (n, K) of a map at ``time`` [s], with mean velocities over the time ``ahead`` [s]. Samples beyond the
    map's edge are read from its neighbour tiles, NaN = no tile."""
    geometry = heightmap.geometry
    inside = (rows >= 0) & (columns >= 0) & (rows < geometry.rows) & (columns < geometry.columns)
    indices = np.where(inside, rows * geometry.columns + columns, 0)
    samples = heightmap.sample(indices, time, ahead)
    outside = ~inside
    if outside.any():
        samples.heights[outside], samples.velocities[outside] = np.nan, 0.0
        if len(terrain.tiles) > 1:
            beyond = terrain.at(heightmap.placed_at(time).to_world(rows[outside], columns[outside]), time)
            samples.heights[outside], samples.velocities[outside] = beyond
    return samples
