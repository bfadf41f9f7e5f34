"""Grid traversal: the nearest vertex of a uniform grid by arithmetic, for all bodies in one pass."""

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray


class Cells(NamedTuple):
    """Nearest vertices of N bodies: row and column, shape (N,)."""

    rows: IntArray
    columns: IntArray


def nearest_vertices(geometry: GridGeometry, positions_w: FloatArray, rim: IntArray | int = 1) -> Cells:
    """Vertices horizontally nearest to ``positions_w`` (N, 2+) [m], at least ``rim`` samples away from the map's edge.

    Leaving out the rim keeps the topology of every patch constant (the report's Chapter 3, Figure 7); bodies beyond it
    get the nearest vertex inside. Assumes a uniform grid, where rounding finds the nearest vertex itself and no
    best-first step is left to take. Ties go to the lower row and column. ``rim`` may differ per body, shape (N,).
    """
    grid = geometry.to_grid(positions_w[:, :2])
    grid -= 0.5
    np.ceil(grid, out=grid)
    rows = np.clip(grid[:, 0], rim, geometry.rows - 1 - rim).astype(np.int64)
    columns = np.clip(grid[:, 1], rim, geometry.columns - 1 - rim).astype(np.int64)
    return Cells(rows, columns)
