"""Grid traversal: the nearest vertex of a uniform grid by arithmetic, for all bodies in one pass."""

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.mesh_shape import UniformGrid


class Cells(NamedTuple):
    """Nearest vertices of N bodies: row and column, shape (N,)."""

    rows: IntArray
    columns: IntArray


def nearest_vertices(geometry: GridGeometry, grid_rc: FloatArray) -> Cells:
    """Vertices horizontally nearest to points given as fractional (row, column), shape (N, 2) (see
    `GridGeometry.to_grid`), the map's rim left out.

    Leaving out the rim keeps the topology of every patch constant (the report's Chapter 3, Figure 7); bodies beyond it
    get the nearest vertex inside. Assumes a uniform grid, where rounding finds the nearest vertex itself and no
    best-first step is left to take. Ties go to the lower row and column.
    """
    nearest = grid_rc - 0.5
    np.ceil(nearest, out=nearest)
    cells = nearest.T.astype(np.int64, order="C")
    np.minimum(cells, geometry.last_inside, out=cells)
    np.maximum(cells, 1, out=cells)
    return Cells(cells[0], cells[1])


def uniform_grid_vertices(grid: UniformGrid, positions_w: FloatArray) -> IntArray:
    """Vertices (N,) of a general mesh that is an evenly spaced grid, horizontally nearest to positions (N, 2+) [m].

    Nothing is left out: a general mesh has patches at its rim, too. Ties go to the lower row and column.
    """
    offset = positions_w[:, :2] - grid.origin
    row = np.ceil(offset @ (grid.per_row / (grid.per_row @ grid.per_row)) - 0.5)
    column = np.ceil(offset @ (grid.per_column / (grid.per_column @ grid.per_column)) - 0.5)
    row = np.clip(row, 0, grid.rows - 1).astype(np.int64)
    return row * grid.columns + np.clip(column, 0, grid.columns - 1).astype(np.int64)
