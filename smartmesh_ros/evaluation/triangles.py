"""Sampling of the triangulated surface of a grid.

Every cell is cut along the diagonal from (row, column) to (row + 1, column + 1), as in the report's Figures 3 and 4.
Heights between samples lie on those two triangles, not on a bilinear patch: a body that collides with triangles and is
measured against anything else hovers or sinks.
"""

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, IntArray


class TrianglePoints(NamedTuple):
    """Barycentric position of N points in a grid: three corners (N, 3) as rows and columns, and weights (N, 3)."""

    rows: IntArray
    columns: IntArray
    weights: FloatArray


def locate(grid_rc: FloatArray, rows: int, columns: int) -> TrianglePoints:
    """Triangles under points given as fractional (row, column), shape (N, 2); points outside use the nearest cell."""
    row = np.clip(np.floor(grid_rc[:, 0]), 0, rows - 2).astype(np.int64)
    column = np.clip(np.floor(grid_rc[:, 1]), 0, columns - 2).astype(np.int64)
    v = grid_rc[:, 0] - row
    u = grid_rc[:, 1] - column
    lower = u >= v  # the triangle (r, c), (r, c+1), (r+1, c+1); the other one is (r, c), (r+1, c+1), (r+1, c)
    corner_rows = np.stack([row, np.where(lower, row, row + 1), row + 1], axis=1)
    corner_columns = np.stack([column, np.where(lower, column + 1, column), column + 1], axis=1)
    weights = np.stack([1.0 - np.maximum(u, v), np.abs(u - v), np.minimum(u, v)], axis=1)
    return TrianglePoints(corner_rows, corner_columns, weights)
