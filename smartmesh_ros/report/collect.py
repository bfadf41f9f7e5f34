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
from smartmesh_ros.terrain.mesh_shape import TriangleGraph
from smartmesh_ros.terrain.trimesh import TriangleMesh


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


BFS: dict[str, Collect] = {"queue_bfs": queue_bfs, "union_bfs": union_bfs}


class PatchTopology(NamedTuple):
    """A patch of a general mesh: its vertices (k,) as indices into the mesh, ascending, and triangles (t, 3) as indices
    into ``vertices``."""

    vertices: IntArray
    triangles: NDArray[np.int32]


def topology_around(mesh: TriangleMesh, vertex: int, rings: int, collect: Collect = union_bfs) -> PatchTopology:
    """The patch of ``rings`` steps around a vertex: all triangles whose three corners were collected (Figure 5)."""
    vertices = np.array(collect(mesh.graph, vertex, rings), np.int64)
    corners = mesh.triangles[mesh.triangles_within(vertices)]
    return PatchTopology(vertices, np.searchsorted(vertices, corners).astype(np.int32))


def cached_topology(mesh: TriangleMesh) -> Callable[[int, int], PatchTopology]:
    """Return `topology_around` of a mesh, by nearest vertex and rings, that remembers patches. They stay valid while
    vertices move, because the triangles stay the same."""
    return lru_cache(MOST_CACHED)(partial(topology_around, mesh))
