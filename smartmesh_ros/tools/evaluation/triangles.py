"""Sampling of the triangulated surface of a grid.

Every cell is cut along the diagonal from (row, column) to (row + 1, column + 1), as in the report's Figures 3 and 4.
Heights between samples are interpolated on these two triangles and not bilinearly. Bodies collide with triangles, so
any other reference surface would show false gaps and penetrations.
"""

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, IntArray


class TrianglePoints(NamedTuple):
    """Barycentric positions of N points in a grid: rows and columns of three corners (N, 3), and weights (N, 3)."""

    rows: IntArray
    columns: IntArray
    weights: FloatArray


def locate(grid_rc: FloatArray, rows: int, columns: int) -> TrianglePoints:
    """Return the triangles at points given as fractional (row, column) (N, 2); points outside use the nearest cell."""
    row = np.clip(np.floor(grid_rc[:, 0]), 0, rows - 2).astype(np.int64)
    column = np.clip(np.floor(grid_rc[:, 1]), 0, columns - 2).astype(np.int64)
    v = grid_rc[:, 0] - row
    u = grid_rc[:, 1] - column
    lower = u >= v  # the triangle (r, c), (r, c+1), (r+1, c+1); the other one is (r, c), (r+1, c+1), (r+1, c)
    corner_rows = np.stack([row, np.where(lower, row, row + 1), row + 1], axis=1)
    corner_columns = np.stack([column, np.where(lower, column + 1, column), column + 1], axis=1)
    weights = np.stack([1.0 - np.maximum(u, v), np.abs(u - v), np.minimum(u, v)], axis=1)
    return TrianglePoints(corner_rows, corner_columns, weights)
