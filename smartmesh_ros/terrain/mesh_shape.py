"""Properties of a general mesh that the searches rely on, checked when it arrives or its vertices move sideways; and
its undirected graph, which defines neighbouring vertices (the report's Chapter 3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray, IntArray


class MeshShape(NamedTuple):
    """Shape of a mesh seen from above.

    ``reason``: why greedy search may miss the nearest vertex, "" if it finds it. ``grid``: the grid that the vertices
    form if their rows and columns are evenly spaced, else None.
    """

    reason: str
    grid: UniformGrid | None


class UniformGrid(NamedTuple):
    """Vertex (r, c) = r * columns + c lies at ``origin`` + r ``per_row`` + c ``per_column`` (x, y) [m]."""

    rows: int
    columns: int
    origin: FloatArray
    per_row: FloatArray
    per_column: FloatArray


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


def shape_of(coordinates: FloatArray, triangles: IntArray) -> MeshShape:
    """Return the shape, seen from above, of a mesh with ``coordinates`` (3, V) [m] and ``triangles`` (T, 3).

    Greedy (best-first) search reaches the vertex nearest to any point from any start exactly on Delaunay
    triangulations of convex regions (Bose and Morin, *Online routing in triangulations*, 2004). The report's weaker
    condition, x and y ascending along rows and columns, is not enough: on a sheared grid the search gets stuck.
    """
    xy = coordinates[:2]
    a, b, c = (xy[:, triangles[:, corner]] for corner in range(3))
    if not ((b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])).all():
        return MeshShape("the mesh overlaps itself seen from above, or a triangle is upright or turned over", None)
    edges = _edges(triangles, coordinates.shape[1])
    if edges is None:
        return MeshShape("an edge belongs to more than two triangles", None)
    inner, opposite, outer = edges
    if not _convex(xy, outer):
        return MeshShape("its outline is not one convex loop, so a search can get stuck at the rim", None)
    if not _delaunay(xy, inner, opposite):
        return MeshShape("its triangles are too slanted (not Delaunay), so a search can get stuck", None)
    return MeshShape("", _uniform_grid(xy, triangles))


def count_parts(triangles: IntArray, count: int) -> int:
    """Return the number of parts, without common vertices, of a mesh of ``triangles`` (T, 3) and ``count`` vertices.
    Vertices of no triangle do not count."""
    part = np.arange(count)  # of each vertex: the lowest vertex known to be in its part
    while True:
        lowest = part[triangles].min(axis=1)
        before = part.copy()
        np.minimum.at(part, part[triangles].ravel(), np.repeat(lowest, 3))
        np.minimum.at(part, triangles.ravel(), np.repeat(lowest, 3))
        part = part[part]
        if (part == before).all():
            return len(np.unique(part[triangles]))


def _edges(triangles: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray] | None:
    """Return inner edges (n, 2), the two vertices opposite to each (n, 2), and outer edges (m, 2).

    Outer edges have the direction of their triangle. Returns None if an edge belongs to more than two triangles.
    """
    start = triangles.ravel()
    end = np.roll(triangles, -1, axis=1).ravel()
    apex = np.roll(triangles, -2, axis=1).ravel()
    keys = np.minimum(start, end) * count + np.maximum(start, end)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.r_[True, keys[1:] != keys[:-1]])
    uses = np.diff(np.r_[first, len(keys)])
    if uses.max() > 2:
        return None
    twice = first[uses == 2]
    once = order[first[uses == 1]]
    inner = np.stack([start[order[twice]], end[order[twice]]], axis=1)
    opposite = np.stack([apex[order[twice]], apex[order[twice + 1]]], axis=1)
    return inner, opposite, np.stack([start[once], end[once]], axis=1)


def _convex(xy: FloatArray, outer: IntArray) -> bool:
    """Return True if the outer edges form one loop that never turns right."""
    if len(np.unique(outer[:, 0])) != len(outer):
        return False
    following = dict(zip(outer[:, 0].tolist(), outer[:, 1].tolist(), strict=True))
    loop = [int(outer[0, 0])]
    while (vertex := following.get(loop[-1], -1)) != loop[0]:
        if vertex < 0 or len(loop) > len(outer):
            return False
        loop.append(vertex)
    if len(loop) != len(outer):
        return False
    points = xy[:, loop]
    side = np.roll(points, -1, axis=1) - points
    after = np.roll(side, -1, axis=1)
    turn = side[0] * after[1] - side[1] * after[0]
    scale = np.linalg.norm(side, axis=0) * np.linalg.norm(after, axis=0)
    return bool((turn >= -1e-9 * scale).all())


def _delaunay(xy: FloatArray, inner: IntArray, opposite: IntArray) -> bool:
    """Return True if the two angles opposite to every inner edge sum to at most pi (exactly pi if cocircular)."""

    def angle(apex: IntArray) -> FloatArray:
        u, v = xy[:, inner[:, 0]] - xy[:, apex], xy[:, inner[:, 1]] - xy[:, apex]
        return np.asarray(np.arctan2(np.abs(u[0] * v[1] - u[1] * v[0]), (u * v).sum(axis=0)))

    return bool((angle(opposite[:, 0]) + angle(opposite[:, 1]) <= np.pi + 1e-9).all())


def _uniform_grid(xy: FloatArray, triangles: IntArray) -> UniformGrid | None:
    """Return the evenly spaced grid that the vertices form, numbered row by row; None if they form none."""
    count = xy.shape[1]
    # In a grid of C columns, vertex 0 shares triangles with vertices 1 and C and, depending on the diagonal, C + 1.
    neighbours = np.unique(triangles[(triangles == 0).any(axis=1)])
    for columns in {int(n) for n in neighbours if n > 1} | {int(n) - 1 for n in neighbours if n > 2}:
        rows, rest = divmod(count, columns)
        if rest or rows < 2 or columns < 2:
            continue
        per_row, per_column = xy[:, columns] - xy[:, 0], xy[:, 1] - xy[:, 0]
        r, c = np.divmod(np.arange(count), columns)
        expected = xy[:, :1] + per_row[:, None] * r + per_column[:, None] * c
        size = max(float(np.abs(per_row).max()), float(np.abs(per_column).max()))
        square = abs(float(per_row @ per_column)) <= 1e-9 * size * size
        if square and np.abs(expected - xy).max() <= 1e-6 * size:
            return UniformGrid(rows, columns, xy[:, 0].copy(), per_row, per_column)
    return None
