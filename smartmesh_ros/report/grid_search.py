"""Nearest vertices of a height map, without its rim, by the configured method."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import SearchMethod
from smartmesh_ros.report.best_first import best_first_cells
from smartmesh_ros.report.brute_force import brute_force_cells
from smartmesh_ros.report.nearest import Cells, nearest_vertices
from smartmesh_ros.report.ray_cast import ray_cast
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray


def nearest_cells(
    method: SearchMethod, geometry: GridGeometry, bodies: IntArray, grid: FloatArray, positions_w: FloatArray,
    before: list[PatchBatch], supports: Any,
) -> Cells:  # fmt: skip
    """Return the vertices nearest to points given as fractional (row, column) (n, 2).

    ``positions_w`` (n, 3) [m]: origins of the rays of the ray-cast search; ``before``: the patches that its rays are
    cast at. ``supports`` (n,): of the last update; best-first search starts in their middle.
    """
    if method in ("auto", "grid_traversal"):
        return nearest_vertices(geometry, grid)
    if method == "brute_force":
        return brute_force_cells(geometry, grid)
    if method == "ray_cast":
        row, column = _hits(bodies, positions_w, before)
        missed = row < 0
        if missed.any():
            row[missed], column[missed] = brute_force_cells(geometry, grid[missed])
        # A ray on a strided patch hits a vertex near the nearest one; best-first search refines the hit.
    else:
        row = supports["row"] + supports["rows"] // 2 * supports["stride"]
        column = supports["column"] + supports["columns"] // 2 * supports["stride"]
    start = Cells(np.clip(row, 1, geometry.rows - 2), np.clip(column, 1, geometry.columns - 2))
    return best_first_cells(geometry, grid, start)


def _hits(bodies: IntArray, positions_w: FloatArray, before: list[PatchBatch]) -> tuple[IntArray, IntArray]:
    """Rows and columns of the vertices that rays from the bodies hit on their last patches, -1 = missed or no patch."""
    place = {body: index for index, body in enumerate(bodies.tolist())}
    rows, columns = np.full(len(bodies), -1), np.full(len(bodies), -1)
    for batch in before:
        if batch.vertices is not None:
            continue  # of a general mesh
        members = [i for i, body in enumerate(batch.bodies.tolist()) if body in place]
        if not members:
            continue
        mine = np.array([place[body] for body in batch.bodies[members].tolist()])
        vertex = ray_cast(positions_w[mine], batch.vertices_w[members], batch.triangles)
        hit, side = vertex >= 0, math.isqrt(batch.vertices_w.shape[1])
        stride = batch.stride[members]
        rows[mine[hit]] = (batch.rows[members] + (vertex // side - side // 2) * stride)[hit]
        columns[mine[hit]] = (batch.columns[members] + (vertex % side - side // 2) * stride)[hit]
    return rows, columns
