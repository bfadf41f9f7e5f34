"""Brute force: compare the distances to all vertices. Correct on every mesh, and O(n)."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.report.nearest import Cells
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry

# Number of grid vertices compared at a time. Raising it costs memory.
CHUNK = 1 << 16


class BruteForce:
    """Search for the vertex of a general mesh nearest in 3D, without assumptions about the mesh.

    Reuses buffers for one mesh size, so that a search allocates nothing.
    """

    def __init__(self, count: int) -> None:
        self._distance = np.empty(count)
        self._part = np.empty(count)

    def nearest(self, coordinates: FloatArray, position_w: FloatArray) -> int:
        """Return the index of the vertex of ``coordinates`` (3, V) [m] nearest to a position (3,) [m].

        Ties go to the lower index.
        """
        distance, part = self._distance, self._part
        np.subtract(coordinates[0], position_w[0], out=distance)
        np.multiply(distance, distance, out=distance)
        for axis in (1, 2):
            np.subtract(coordinates[axis], position_w[axis], out=part)
            np.multiply(part, part, out=part)
            np.add(distance, part, out=distance)
        return int(distance.argmin())


def brute_force_cells(geometry: GridGeometry, grid_rc: FloatArray) -> Cells:
    """Return the vertices of a height map, without its rim, nearest to points given as fractional (row, column) (N, 2).

    Compares horizontal distances to all vertices. Ties go to the lower row and column.
    """
    columns = np.arange(1, geometry.columns - 1, dtype=np.float64)
    step = max(1, CHUNK // len(columns))
    found = np.empty((2, len(grid_rc)), np.int64)
    for index, (row, column) in enumerate(grid_rc):
        across = (columns - column) ** 2
        best = np.inf
        for first in range(1, geometry.rows - 1, step):
            rows = np.arange(first, min(first + step, geometry.rows - 1), dtype=np.float64)
            distance = (rows - row)[:, None] ** 2 + across
            nearest = int(distance.argmin())
            if distance.flat[nearest] < best:
                best = distance.flat[nearest]
                found[:, index] = first + nearest // len(columns), 1 + nearest % len(columns)
    return Cells(found[0], found[1])
