"""Nearest vertices of a height map by the configured method, with the last result as the next start."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import SearchMethod
from smartmesh_ros.patches.slot_rows import with_rows
from smartmesh_ros.report.best_first import best_first_cells
from smartmesh_ros.report.brute_force import brute_force_cells
from smartmesh_ros.report.nearest import Cells, nearest_vertices
from smartmesh_ros.report.ray_cast import ray_cast
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray


class GridSearch:
    """Searches nearest vertices, excluding the map's rim. Bodies are addressed by slot."""

    def __init__(self) -> None:
        self._row = np.empty(0, np.int64)  # nearest vertex at the last update, -1 = none
        self._column = np.empty(0, np.int64)

    def reserve(self, slots: int) -> None:
        """Make room for bodies in ``slots`` slots."""
        self._row, self._column = with_rows(self._row, slots, -1), with_rows(self._column, slots, -1)

    def forget(self, bodies: IntArray | slice) -> None:
        """Discard the last vertices of ``bodies``."""
        self._row[bodies] = self._column[bodies] = -1

    def nearest(
        self,
        method: SearchMethod,
        geometry: GridGeometry,
        bodies: IntArray,
        grid: FloatArray,
        positions_w: FloatArray,
        before: list[PatchBatch],
    ) -> Cells:
        """Return the vertices nearest to points given as fractional (row, column) (n, 2).

        ``positions_w`` (n, 3) [m]: origins of the rays of the ray-cast search; ``before``: the patches that its rays
        are cast at.
        """
        if method in ("auto", "grid_traversal"):
            return nearest_vertices(geometry, grid)
        if method == "brute_force":
            return brute_force_cells(geometry, grid)
        row, column = self._row[bodies], self._column[bodies]
        if method == "ray_cast":
            row, column = _hits(bodies, positions_w, before)
            missed = row < 0
            if missed.any():
                row[missed], column[missed] = brute_force_cells(geometry, grid[missed])
            # A ray on a strided patch hits a vertex near the nearest one; best-first search refines the hit.
        else:
            row = np.where(row < 0, geometry.rows // 2, row)
            column = np.where(column < 0, geometry.columns // 2, column)
        start = Cells(np.clip(row, 1, geometry.rows - 2), np.clip(column, 1, geometry.columns - 2))
        found = best_first_cells(geometry, grid, start)
        self._row[bodies], self._column[bodies] = found
        return found


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
