"""Signed distance from points to the triangulated surface of a height map, the basis of all accuracy figures.

The distance is independent of patches, so the same measure applies to all colliders and simulators. Every cell is cut
along the diagonal from (row, column) to (row + 1, column + 1), as in the report's Figures 3 and 4. Bodies collide with
these triangles, so a bilinear surface would show false gaps and penetrations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray

# Number of vertices processed at a time. Raising it costs memory.
CHUNK = 2_000_000


@dataclass(frozen=True)
class Surface:
    """The main mesh at one instant: ``heights`` (rows, columns) [m], NaN = no ground, on ``geometry``."""

    geometry: GridGeometry
    heights: NDArray[Any]

    @cached_property
    def steepest(self) -> float:
        """Upper bound of the slope of all triangles [-]."""
        across = [np.abs(np.diff(self.heights, axis=axis)) for axis in (0, 1)]
        largest = [float(np.nanmax(steps)) if np.isfinite(steps).any() else 0.0 for steps in across]
        return math.hypot(*largest) / self.geometry.resolution

    def below(self, points: FloatArray) -> FloatArray:
        """Return the heights (N,) [m] of the ground under points (N, 3) [m]; NaN where there is no ground."""
        rows, columns, heights = self.geometry.rows, self.geometry.columns, self.heights
        grid = self.geometry.to_grid(points[:, :2])
        row = np.clip(np.floor(grid[:, 0]), 0, rows - 2).astype(np.int64)
        column = np.clip(np.floor(grid[:, 1]), 0, columns - 2).astype(np.int64)
        v, u = grid[:, 0] - row, grid[:, 1] - column
        lower = u >= v  # the triangle (r, c), (r, c+1), (r+1, c+1); the other one is (r, c), (r+1, c+1), (r+1, c)
        third = heights[np.where(lower, row, row + 1), np.where(lower, column + 1, column)]
        corners = np.stack([heights[row, column], third, heights[row + 1, column + 1]])
        weights = np.stack([1.0 - np.maximum(u, v), np.abs(u - v), np.minimum(u, v)])
        found = (np.where(weights > 0.0, corners, 0.0) * weights).sum(axis=0) + self.geometry.origin[2]
        outside = ((grid < -1e-9) | (grid > (rows - 1 + 1e-9, columns - 1 + 1e-9))).any(axis=1)
        found[outside] = np.nan
        return np.asarray(found)


class Nearest(NamedTuple):
    """Distances and normals of N points.

    ``distance``: to the surface (N,) [m], positive above it, at most the given reach. ``normal``: unit vector from the
    nearest point of the surface outwards (N, 3), in the axes of the grid; not finite on the surface and beyond the
    reach.
    """

    distance: FloatArray
    normal: FloatArray


def nearest(surface: Surface, points: FloatArray, reach: float) -> Nearest:
    """Return the exact distances to the nearest triangle for points (N, 3) [m] within ``reach`` [m] of it.

    The sign is that of the vertical gap; without ground below, a point counts as above. Non-finite positions give NaN.
    """
    half = math.ceil(reach / surface.geometry.resolution + 1.5)
    step = max(1, CHUNK // (2 * half + 1) ** 2)
    distance = np.full(len(points), np.nan)
    normal = np.full((len(points), 3), np.nan)
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    for start in range(0, len(finite), step):
        chosen = finite[start : start + step]
        distance[chosen], normal[chosen] = _nearest(surface, points[chosen], reach, half)
    return Nearest(distance, normal)


def _nearest(surface: Surface, points: FloatArray, reach: float, half: int) -> Nearest:
    geometry = surface.geometry
    gap = points[:, 2] - surface.below(points)
    sign = np.where(gap < 0.0, -1.0, 1.0)
    along = geometry.to_grid(points[:, :2])[:, ::-1] * geometry.resolution
    points = np.column_stack([along, points[:, 2] - geometry.origin[2]])  # in the grid's frame
    owner, corners = _candidates(surface, points, np.abs(gap), reach, half)
    distance = np.full(len(points), reach)
    normal = np.full((len(points), 3), np.nan)
    if len(owner):
        offsets = points[owner] - closest_points(points[owner], corners)
        squared = np.einsum("ij,ij->i", offsets, offsets)
        order = np.lexsort((squared, owner))
        first = order[np.r_[True, np.diff(owner[order]) > 0]]
        found = np.sqrt(squared[first])
        within = found < reach
        first, found = first[within], found[within]
        bodies = owner[first]
        distance[bodies] = found
        with np.errstate(divide="ignore", invalid="ignore"):
            normal[bodies] = offsets[first] * sign[bodies, None] / found[:, None]
    return Nearest(sign * distance, normal)


def _candidates(
    surface: Surface, points: FloatArray, gap: FloatArray, reach: float, half: int
) -> tuple[IntArray, FloatArray]:
    """Return the triangles that may contain the nearest point: indices of the points (P,), and corners (P, 3, 3); all
    points in the grid's frame.

    The nearest vertex and the vertical gap are upper bounds of the distance. Every point of a triangle is at most the
    longest edge over the square root of three from one of its corners. Triangles whose corners are all farther away
    than the sum of both are skipped.
    """
    (rows, columns), resolution = surface.heights.shape, surface.geometry.resolution
    middle = np.rint(points[:, :2] / resolution).astype(np.int64)
    window = np.arange(-half, half + 1)
    c, r = (middle[:, :1] + window)[:, None, :], (middle[:, 1:] + window)[:, :, None]
    inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
    z = np.where(inside, surface.heights[np.clip(r, 0, rows - 1), np.clip(c, 0, columns - 1)], np.nan)
    vertices = np.stack(np.broadcast_arrays(c * resolution, r * resolution, z), axis=-1)
    away = np.nan_to_num(np.linalg.norm(vertices - points[:, None, None], axis=-1), nan=np.inf)
    bound = np.fmin(np.fmin(away.min(axis=(1, 2)), gap), reach)
    with np.errstate(invalid="ignore"):
        drop = np.fmax.reduce(_corners(z)) - np.fmin.reduce(_corners(z))
    longest = np.sqrt(2.0 * resolution**2 + drop**2)
    near = np.min(_corners(away), axis=0) <= bound[:, None, None] + longest / math.sqrt(3.0) + 1e-9
    # A missing corner removes one or both of the cell's triangles.
    first, second, third, fourth = (corner[near] for corner in _corners(vertices))
    found = np.concatenate([np.stack([first, second, third], axis=1), np.stack([first, third, fourth], axis=1)])
    whole = np.isfinite(found[:, :, 2]).all(axis=1)
    return np.tile(np.nonzero(near)[0], 2)[whole], found[whole]


def _corners(samples: FloatArray) -> tuple[FloatArray, ...]:
    """Return the values at the four corners of each cell, counter-clockwise, from those of samples (B, R, C, ...)."""
    return samples[:, :-1, :-1], samples[:, :-1, 1:], samples[:, 1:, 1:], samples[:, 1:, :-1]


def closest_points(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the closest point (P, 3) of each triangle (P, 3, 3) to each point (P, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    aa, bb, cc = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    u, v = _dot(ap, ab), _dot(ap, ac)
    scale = np.maximum(aa * cc - bb * bb, 1e-300)
    s, t = (cc * u - bb * v) / scale, (aa * v - bb * u) / scale
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    found = [np.where(inside[:, None], a + ab * s[:, None] + ac * t[:, None], np.inf)]
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        along = np.clip(_dot(points - start, edge) / np.maximum(_dot(edge, edge), 1e-300), 0.0, 1.0)
        found.append(start + edge * along[:, None])
    best = np.argmin([_dot(points - each, points - each) for each in found], axis=0)
    return np.asarray(np.stack(found)[best, np.arange(len(points))])


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", first, second))
