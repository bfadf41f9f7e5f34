"""Best-first search: walk from the previous nearest vertex to the nearest neighbour, until no neighbour is nearer.

Distances are horizontal (the report's h(n) = |N - P|, Chapter 3). Ties go to the lower index in all searches.
"""

from __future__ import annotations

import numpy as np

from smartmesh_ros.report.nearest import Cells
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh

# The eight neighbours of a grid vertex, in ascending order of their index, and the vertex itself first.
_ROW_STEPS = np.array([0, -1, -1, -1, 0, 0, 1, 1, 1])
_COLUMN_STEPS = np.array([0, -1, 0, 1, -1, 1, -1, 0, 1])


def best_first_vertices(mesh: TriangleMesh, table: IntArray, positions_w: FloatArray, starts: IntArray) -> IntArray:
    """Return the nearest vertices (N,) for positions (N, 3) [m] and starts (N,); ``table``: from `padded`."""
    x, y = mesh.coordinates[:2]
    found = starts.copy()
    walking = np.arange(len(found))
    while walking.size:
        here = found[walking]
        options = np.concatenate([here[:, None], table[here]], axis=1)
        options.sort(axis=1)  # so that argmin returns the lowest index among equal distances
        place = positions_w[walking]
        distance = (x[options] - place[:, :1]) ** 2 + (y[options] - place[:, 1:2]) ** 2
        best = options[np.arange(len(options)), distance.argmin(axis=1)]
        found[walking] = best
        walking = walking[best != here]
    return found


def best_first_cells(geometry: GridGeometry, grid_rc: FloatArray, starts: Cells) -> Cells:
    """Return the vertices of a height map, without its rim, nearest to points given as fractional (row, column) (N, 2).

    Walks over the eight-neighbour graph (Figure 6) from ``starts``, which must not lie on the rim.
    """
    rows, columns = starts.rows.copy(), starts.columns.copy()
    walking = np.arange(len(rows))
    while walking.size:
        near_rows = np.clip(rows[walking, None] + _ROW_STEPS, 1, geometry.rows - 2)
        near_columns = np.clip(columns[walking, None] + _COLUMN_STEPS, 1, geometry.columns - 2)
        place = grid_rc[walking]
        distance = (near_rows - place[:, :1]) ** 2 + (near_columns - place[:, 1:2]) ** 2
        index = near_rows * geometry.columns + near_columns
        nearest = distance.min(axis=1, keepdims=True)
        best = np.where(distance == nearest, index, np.iinfo(np.int64).max).min(axis=1)
        moved = best != index[:, 0]
        rows[walking], columns[walking] = np.divmod(best, geometry.columns)
        walking = walking[moved]
    return Cells(rows, columns)
