"""Collect the vertices of a patch around its nearest vertex (the report's Chapter 3).

``rings`` is the report's collider-size: the number of steps from the nearest vertex. Every method returns the same
vertices in ascending order.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray


class GridGraph:
    """The graph of a grid: eight neighbours around each vertex, independent of the triangles (Figure 6).

    Edges are computed, not stored: a map of 4096 x 4096 has 134 million.
    """

    def __init__(self, rows: int, columns: int) -> None:
        self.rows, self.columns = rows, columns

    def neighbours(self, vertex: int) -> list[int]:
        """Return the vertices around ``vertex``: eight inside, five at an edge, three in a corner."""
        row, column = divmod(vertex, self.columns)
        return [
            r * self.columns + c
            for r in (row - 1, row, row + 1)
            if 0 <= r < self.rows
            for c in (column - 1, column, column + 1)
            if 0 <= c < self.columns and (r, c) != (row, column)
        ]


class TriangleGraph:
    """The graph of ``triangles`` (T, 3) among ``count`` vertices, as two compact arrays: vertices that share a triangle
    are neighbours (Figures 4 and 9)."""

    def __init__(self, triangles: NDArray[np.integer], count: int) -> None:
        self.triangles = np.asarray(triangles, np.int64)
        edges = np.concatenate([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])
        keys = np.unique(np.concatenate([edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]]))
        # Reading one number from a memoryview is several times faster than from an array.
        self._targets = memoryview(keys % count)  # type: ignore[arg-type]  # NumPy arrays are buffers
        self._offsets = memoryview(np.searchsorted(keys // count, np.arange(count + 1)))  # type: ignore[arg-type]
        corners = np.argsort(self.triangles.ravel(), kind="stable")
        self._incident = corners // 3  # triangles, sorted by vertex
        self._incident_at = np.searchsorted(self.triangles.ravel()[corners], np.arange(count + 1))

    def neighbours(self, vertex: int) -> list[int]:
        """Return the vertices that share a triangle with ``vertex``."""
        return self._targets[self._offsets[vertex] : self._offsets[vertex + 1]].tolist()

    def triangles_within(self, vertices: IntArray) -> IntArray:
        """Return the triangles (n,), ascending, whose corners are all among ``vertices`` (k,)."""
        starts, ends = self._incident_at[vertices], self._incident_at[vertices + 1]
        touched = np.unique(
            np.concatenate([self._incident[start:end] for start, end in zip(starts, ends, strict=True)])
        )
        inside: IntArray = touched[np.isin(self.triangles[touched], vertices).all(axis=1)]
        return inside


# Graphs, whose `neighbours` are in ascending order.
Graph = GridGraph | TriangleGraph
Collect = Callable[[Graph, int, int], list[int]]
# Most patches to remember; those of 8 rings then have some four million vertices.
MOST_CACHED = 16384


def queue_bfs(graph: Graph, start: int, rings: int) -> list[int]:
    """Return the vertices within ``rings`` steps of ``start`` by breadth-first search with a queue."""
    depth = {start: 0}
    queue = deque([start])
    while queue:
        vertex = queue.popleft()
        if depth[vertex] == rings:
            continue
        for neighbour in graph.neighbours(vertex):
            if neighbour not in depth:
                depth[neighbour] = depth[vertex] + 1
                queue.append(neighbour)
    return sorted(depth)


def union_bfs(graph: Graph, start: int, rings: int) -> list[int]:
    """Return the same vertices by uniting neighbour sets, one ring at a time (Figure 11)."""
    found = {start}
    ring = {start}
    for _ in range(rings):
        ring = set().union(*map(graph.neighbours, ring)) - found
        found |= ring
    return sorted(found)


class PatchTopology(NamedTuple):
    """A patch of a general mesh: its vertices (k,) as indices into the mesh, ascending, and triangles (t, 3) as indices
    into ``vertices``."""

    vertices: IntArray
    triangles: NDArray[np.int32]


def topology_around(graph: TriangleGraph, vertex: int, rings: int, collect: Collect = union_bfs) -> PatchTopology:
    """The patch of ``rings`` steps around a vertex: all triangles whose three corners were collected (Figure 5)."""
    vertices = np.array(collect(graph, vertex, rings), np.int64)
    corners = graph.triangles[graph.triangles_within(vertices)]
    return PatchTopology(vertices, np.searchsorted(vertices, corners).astype(np.int32))


def cached_topology(graph: TriangleGraph) -> Callable[[int, int], PatchTopology]:
    """Return `topology_around` of a graph, by nearest vertex and rings, that remembers patches. They stay valid while
    vertices move, because the triangles stay the same."""
    return lru_cache(MOST_CACHED)(partial(topology_around, graph))
