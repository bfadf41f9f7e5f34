"""The report's Chapter 3: searches of the vertex nearest to a body, and collecting the vertices of a patch around it,
on height maps without their rim, and on general meshes.

Distances are horizontal (the report's h(n) = |N - P|), but those of brute force on a general mesh. Ties go to the lower
index.

- *Grid traversal* computes the nearest vertices of a uniform grid by rounding, for all bodies at once.
- *Best-first search* walks from the previous nearest vertex to the nearest neighbour, until no neighbour is nearer. It
  reaches the nearest vertex from any start exactly on Delaunay triangulations of convex regions (Bose and Morin,
  *Online routing in triangulations*, 2004). The report's weaker condition, x and y ascending along rows and columns, is
  not enough: on a sheared grid the search gets stuck.
- *Brute force* compares the distances to all vertices. Correct on every mesh, and O(n).
- *Ray cast*, the report's first implementation, casts a vertical ray from the body onto its previous patch, and is only
  timed here. The ray is intersected with the patch's triangles and not by the engine, because patches collide with
  their own body only and so are invisible to the engine's rays.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros import GridGeometry
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh

# From a grid vertex to itself and to its eight neighbours, row and column.
_STEPS = np.array([(0, 0), (-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)])
# Number of grid vertices compared at a time. Raising it costs memory.
CHUNK = 1 << 16
# Smallest barycentric weight of a hit. Slightly negative, so that a ray at an edge hits one of the two triangles.
ON_EDGE = -1e-9


def nearest_vertices(geometry: GridGeometry, grid_rc: FloatArray) -> IntArray:
    """Return the vertices (N, 2), row and column, without the map's rim, horizontally nearest to points given as
    fractional (row, column).

    ``grid_rc``: (N, 2), see `GridGeometry.to_grid`. The rim is excluded to keep the topology of every patch constant
    (the report's Chapter 3, Figure 7); bodies beyond it get the nearest vertex inside. On a uniform grid, rounding
    gives the nearest vertex, so no best-first step is needed. Ties go to the lower row and column.
    """
    cells: IntArray = np.ceil(grid_rc - 0.5).astype(np.int64)
    np.minimum(cells, [geometry.rows - 2, geometry.columns - 2], out=cells)
    return np.maximum(cells, 1, out=cells)


def best_first_vertex(mesh: TriangleMesh, graph: TriangleGraph, position_w: FloatArray, start: int) -> int:
    """Return the vertex of a general mesh horizontally nearest to a position (3,) [m], walking from ``start``.

    The cost is proportional to the number of steps: one or two for a body that moves continuously, up to the width of
    the mesh for one that teleports.
    """
    coordinates = mesh.vertices.T
    xs, ys = memoryview(coordinates[0]), memoryview(coordinates[1])
    x, y = float(position_w[0]), float(position_w[1])
    neighbours = graph.neighbours
    best = start
    least = (xs[start] - x) ** 2 + (ys[start] - y) ** 2
    while True:
        here = best
        for vertex in neighbours(here):
            distance = (xs[vertex] - x) ** 2 + (ys[vertex] - y) ** 2
            if distance < least or (distance == least and vertex < best):
                least, best = distance, vertex
        if best == here:
            return best


def best_first_cells(geometry: GridGeometry, grid_rc: FloatArray, starts: IntArray) -> IntArray:
    """Return the vertices (N, 2) of a height map, without its rim, nearest to points given as fractional (row, column)
    (N, 2).

    Walks over the eight-neighbour graph (Figure 6) from ``starts`` (N, 2), which must not lie on the rim.
    """
    found, walking = starts.copy(), np.arange(len(starts))
    last = [geometry.rows - 2, geometry.columns - 2]
    while walking.size:
        near = np.clip(found[walking, None] + _STEPS, 1, last)
        distance = ((near - grid_rc[walking, None]) ** 2).sum(axis=2)
        index = near[..., 0] * geometry.columns + near[..., 1]
        nearest = distance.min(axis=1, keepdims=True)
        best = np.where(distance == nearest, index, np.iinfo(np.int64).max).min(axis=1)
        found[walking] = np.stack(np.divmod(best, geometry.columns), axis=1)
        walking = walking[best != index[:, 0]]
    return found


def brute_force_vertex(coordinates: FloatArray, position_w: FloatArray) -> int:
    """Return the vertex of ``coordinates`` (3, V) [m] nearest in 3D to a position (3,) [m], without assumptions about
    the mesh."""
    return int(((coordinates - position_w[:, None]) ** 2).sum(axis=0).argmin())


def brute_force_cells(geometry: GridGeometry, grid_rc: FloatArray) -> IntArray:
    """Return the vertices (N, 2) of a height map, without its rim, nearest to points given as fractional (row, column)
    (N, 2).

    Compares horizontal distances to all vertices. Ties go to the lower row and column.
    """
    columns = np.arange(1, geometry.columns - 1, dtype=np.float64)
    step = max(1, CHUNK // len(columns))
    found = np.empty((len(grid_rc), 2), np.int64)
    for index, (row, column) in enumerate(grid_rc):
        across = (columns - column) ** 2
        best = np.inf
        for first in range(1, geometry.rows - 1, step):
            rows = np.arange(first, min(first + step, geometry.rows - 1), dtype=np.float64)
            distance = (rows - row)[:, None] ** 2 + across
            nearest = int(distance.argmin())
            if distance.flat[nearest] < best:
                best = distance.flat[nearest]
                found[index] = first + nearest // len(columns), 1 + nearest % len(columns)
    return found


def ray_cast(position_w: FloatArray, vertices_w: FloatArray, triangles: NDArray[np.integer]) -> int:
    """Return the vertex of a patch, 0 .. K - 1, nearest to the hit of a ray down from a body; -1 = no hit.

    ``position_w``: (3,) [m]. ``vertices_w``: (K, 3) [m]. ``triangles``: (T, 3) corners among the K vertices. Distances
    from the hit are horizontal; ties go to the lower vertex.
    """
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (vertices_w[triangles[:, corner]].T for corner in range(3))
    x, y, z = position_w
    with np.errstate(divide="ignore", invalid="ignore"):
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
        w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
        u = 1.0 - v - w
        height = u * az + v * bz + w * cz
        hit = (u >= ON_EDGE) & (v >= ON_EDGE) & (w >= ON_EDGE) & (height <= z)
    if not hit.any():
        return -1
    # If a patch overlaps itself, the ray hits the highest triangle first. Equally high triangles share the nearest
    # corner.
    options = np.sort(triangles[np.where(hit, height, -np.inf).argmax()])
    return int(options[((vertices_w[options, :2] - position_w[:2]) ** 2).sum(axis=1).argmin()])


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
