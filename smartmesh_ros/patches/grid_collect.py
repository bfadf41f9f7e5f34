"""Samples of patches of a height map, by the chosen method, across tiles where patches cross."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.collect import BFS, CollectMethod
from smartmesh_ros.patches.template import PatchTemplate
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.terrain.graph import GridGraph
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain


class Collected(NamedTuple):
    """Ground of n patches of K samples: heights (n, K) [m], vertical velocities (n, K) [m/s] or None at rest, and
    whether any height may be NaN."""

    heights: FloatArray
    velocities: FloatArray | None
    holes: bool


def fit_in(geometry: GridGeometry, cells: Cells, margin: IntArray | int) -> Cells:
    """The centres moved off the map's edge by ``margin`` samples: a rim as wide as the patch keeps its topology."""
    rows = np.maximum(np.minimum(cells.rows, geometry.rows - 1 - margin), margin)
    columns = np.maximum(np.minimum(cells.columns, geometry.columns - 1 - margin), margin)
    return Cells(rows, columns)


def collect_inside(
    heightmap: HeightMap, template: PatchTemplate, cells: Cells, stride: IntArray, time: float, method: CollectMethod,
    *, velocities: bool = True,
) -> Collected:  # fmt: skip
    """Samples of patches that lie inside their map; without ``velocities`` nobody needs those."""
    geometry = heightmap.geometry
    centres = cells.rows * geometry.columns + cells.columns
    if method == "cached":
        indices = template.indices(geometry.columns) * stride[:, None]
        indices += centres[:, None]
    else:
        collect = BFS[method]
        indices = np.array(
            [
                collect(GridGraph(geometry.rows, geometry.columns, step), centre, template.rings)
                for centre, step in zip(centres.tolist(), stride.tolist(), strict=True)
            ],
            np.int64,
        ).reshape(len(centres), template.rows.size)
    samples = heightmap.sample(indices, centres, time, velocities=velocities)
    return Collected(samples.heights, samples.velocities, heightmap.has_holes)


def collect_across(
    terrain: Terrain, heightmap: HeightMap, template: PatchTemplate, cells: Cells, stride: IntArray, time: float
) -> Collected:
    """Samples of patches that may reach over the edge of their tile: there the ground is that of the neighbours."""
    geometry = heightmap.geometry
    r = cells.rows[:, None] + template.rows * stride[:, None]
    c = cells.columns[:, None] + template.columns * stride[:, None]
    inner_r, inner_c = np.clip(r, 0, geometry.rows - 1), np.clip(c, 0, geometry.columns - 1)
    indices = inner_r * geometry.columns + inner_c
    heights, velocities = heightmap.sample(indices, indices[:, template.centre], time)
    outside = (inner_r != r) | (inner_c != c)
    if not outside.any():
        return Collected(heights, velocities, heightmap.has_holes)
    beyond = terrain.around(geometry.to_world(r[outside], c[outside]), time)
    heights[outside] = beyond.heights
    if beyond.velocities is not None or velocities is not None:
        velocities = np.zeros_like(heights) if velocities is None else velocities
        velocities[outside] = 0.0 if beyond.velocities is None else beyond.velocities
    return Collected(heights, velocities, True)
