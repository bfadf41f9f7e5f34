"""The undirected graph of a main mesh, which defines neighbouring vertices (the report's Chapter 3)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray


class Graph(Protocol):
    """Neighbours by vertex, in ascending order."""

    def neighbours(self, vertex: int) -> list[int]:
        """Return the vertices that share an edge with ``vertex``."""
        ...


class TriangleGraph:
    """Vertices that share a triangle are neighbours (Figures 4 and 9), as two compact arrays.

    The neighbours of vertex v are ``targets[offsets[v] : offsets[v + 1]]``.
    """

    def __init__(self, triangles: NDArray[np.integer], count: int) -> None:
        corners = np.asarray(triangles, np.int64)
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
        keys = np.unique(np.concatenate([edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]]))
        self.targets: IntArray = keys % count
        self.offsets: IntArray = np.searchsorted(keys // count, np.arange(count + 1))
        # Reading one number from a memoryview is several times faster than from an array.
        self._targets = memoryview(self.targets)  # type: ignore[arg-type]  # NumPy arrays are buffers
        self._offsets = memoryview(self.offsets)  # type: ignore[arg-type]

    def neighbours(self, vertex: int) -> list[int]:
        """Return the vertices that share a triangle with ``vertex``."""
        return self._targets[self._offsets[vertex] : self._offsets[vertex + 1]].tolist()

    def padded(self) -> IntArray:
        """Return the neighbours as one row per vertex (V, largest number of neighbours), padded with the vertex."""
        counts = np.diff(self.offsets)
        table = np.repeat(np.arange(len(counts))[:, None], int(counts.max(initial=0)), axis=1)
        column = np.arange(len(self.targets)) - np.repeat(self.offsets[:-1], counts)
        table[np.repeat(np.arange(len(counts)), counts), column] = self.targets
        return table


class GridGraph:
    """The graph of a grid: eight neighbours around each vertex, independent of the triangles (Figure 6).

    Edges are computed, not stored: a map of 4096 x 4096 has 134 million. ``stride`` > 1 joins every stride-th vertex.
    """

    def __init__(self, rows: int, columns: int, stride: int = 1) -> None:
        self.rows, self.columns, self.stride = rows, columns, stride

    def neighbours(self, vertex: int) -> list[int]:
        """Return the vertices around ``vertex``: eight inside, five at an edge, three in a corner."""
        row, column = divmod(vertex, self.columns)
        stride = self.stride
        return [
            r * self.columns + c
            for r in (row - stride, row, row + stride)
            if 0 <= r < self.rows
            for c in (column - stride, column, column + stride)
            if 0 <= c < self.columns and (r, c) != (row, column)
        ]
