"""Collect the vertices of a patch around its nearest vertex (the report's Chapter 3).

``rings`` is the report's collider-size: the number of steps from the nearest vertex. Every method returns the same
vertices in ascending order.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.graph import Graph
from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh

Collect = Callable[[Graph, int, int], list[int]]


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


class TopologyCache:
    """Cache of patches by nearest vertex and rings; valid while vertices move, because the triangles stay the same.

    Filled on demand. The least recently used patches are evicted beyond ``most_vertices`` vertices in total.
    """

    def __init__(self, mesh: TriangleMesh, most_vertices: int = 4_000_000) -> None:
        self._mesh = mesh
        self._most = most_vertices
        self._held = 0
        self._patches: OrderedDict[tuple[int, int], PatchTopology] = OrderedDict()

    def __len__(self) -> int:
        return len(self._patches)

    def around(self, vertex: int, rings: int) -> PatchTopology:
        """The patch of ``rings`` steps around a vertex."""
        key = (vertex, rings)
        patch = self._patches.get(key)
        if patch is not None:
            self._patches.move_to_end(key)
            return patch
        patch = self._patches[key] = topology_around(self._mesh, vertex, rings)
        self._held += len(patch.vertices)
        while self._held > self._most and len(self._patches) > 1:
            self._held -= len(self._patches.popitem(last=False)[1].vertices)
        return patch
