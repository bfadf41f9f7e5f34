"""Grid traversal: compute the nearest vertices of a uniform grid by rounding, for all bodies at once."""

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.mesh_shape import UniformGrid


class Cells(NamedTuple):
    """Nearest vertices of N bodies: rows and columns, shape (N,)."""

    rows: IntArray
    columns: IntArray


def nearest_vertices(geometry: GridGeometry, grid_rc: FloatArray) -> Cells:
    """Return the vertices, without the map's rim, horizontally nearest to points given as fractional (row, column).

    ``grid_rc``: (N, 2), see `GridGeometry.to_grid`. The rim is excluded to keep the topology of every patch constant
    (the report's Chapter 3, Figure 7); bodies beyond it get the nearest vertex inside. On a uniform grid, rounding
    gives the nearest vertex, so no best-first step is needed. Ties go to the lower row and column.
    """
    nearest = grid_rc - 0.5
    np.ceil(nearest, out=nearest)
    cells = nearest.T.astype(np.int64, order="C")
    np.minimum(cells, geometry.last_inside, out=cells)
    np.maximum(cells, 1, out=cells)
    return Cells(cells[0], cells[1])


def uniform_grid_vertices(grid: UniformGrid, positions_w: FloatArray) -> IntArray:
    """Return the vertices (N,) of an evenly spaced general mesh horizontally nearest to positions (N, 2+) [m].

    The rim is included, because patches of a general mesh may lie there. Ties go to the lower row and column.
    """
    offset = positions_w[:, :2] - grid.origin
    row = np.ceil(offset @ (grid.per_row / (grid.per_row @ grid.per_row)) - 0.5)
    column = np.ceil(offset @ (grid.per_column / (grid.per_column @ grid.per_column)) - 0.5)
    row = np.clip(row, 0, grid.rows - 1).astype(np.int64)
    return row * grid.columns + np.clip(column, 0, grid.columns - 1).astype(np.int64)
