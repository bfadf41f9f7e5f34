"""The ground around the bodies, as a mesh to be drawn."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import grid_triangles

# Cells along each side of the ground that is drawn; more show smaller features, and cost more to compute and to send.
CELLS = 64
# Ground beside the outermost bodies, and side of the ground without bodies [m].
MARGIN, ALONE = 3.0, 20.0
# Largest side [m]; bodies farther from the median of all are left aside.
WIDEST = 60.0
# How far below the true ground it is drawn [m], so that patches lie on it.
LOWER = 0.01


class Window(NamedTuple):
    """A square of the ground: position ``x``, ``y`` of its first sample, and the distance of its samples [m]."""

    x: float
    y: float
    spacing: float


def window_around(positions_w: FloatArray, terrain: Terrain) -> Window | None:
    """Return the window that shows the ground around bodies (n, 2+) [m], or the middle of the terrain if there are
    none; None without terrain. Its samples are those of the first height map, or every so many-th one."""
    if not terrain.tiles:
        return None
    ends = np.concatenate([_bounds(tile) for tile in terrain.tiles.values()])
    lowest, highest = ends.min(axis=0), ends.max(axis=0)
    middle, half = 0.5 * (lowest + highest), 0.5 * ALONE
    low, high = middle - half, middle + half
    if len(positions_w):
        xy_w = positions_w[:, :2]
        away = np.abs(xy_w - np.median(xy_w, axis=0)).max(axis=1)
        near = away <= 0.5 * WIDEST
        near[(away <= away.min() + MARGIN).argmax()] = True  # of bodies that are all far away the first
        low, high = xy_w[near].min(axis=0) - MARGIN, xy_w[near].max(axis=0) + MARGIN
    low, high = np.clip(low, lowest, highest), np.clip(high, lowest, highest)
    side = max(float((high - low).max()), 2.0 * MARGIN)
    maps = [tile.geometry for tile in terrain.tiles.values() if isinstance(tile, HeightMap)]
    finest = maps[0].resolution if maps else side / CELLS
    spacing = finest * max(math.ceil(side / (CELLS * finest) - 1e-9), 1)
    anchor = np.array(maps[0].origin[:2] if maps else (0.0, 0.0))
    first = 0.5 * (low + high) - 0.5 * CELLS * spacing
    x, y = (anchor + np.round((first - anchor) / spacing) * spacing).tolist()
    return Window(x, y, spacing)


def ground_points(window: Window, terrain: Terrain, time: float, patches_w: FloatArray) -> FloatArray:
    """Return the corners (n, 3) [m] of the triangles of a window at ``time`` [s], below the points ``patches_w`` (p, 3)
    [m] of patches. Their number is always the same: those at holes have no area."""
    count = CELLS + 1
    rows, columns = np.divmod(np.arange(count * count), count)
    xy = np.stack([window.x + columns * window.spacing, window.y + rows * window.spacing], axis=1)
    vertices = np.column_stack([xy, terrain.at(xy, time).heights - LOWER])
    _lower(vertices, window, patches_w)
    corners = vertices[grid_triangles(count, count)]
    holes = np.isnan(corners[..., 2]).any(axis=1)
    if holes.any():
        corners[holes] = corners[~holes][0, 0] if not holes.all() else (window.x, window.y, 0.0)
    return corners.reshape(-1, 3)


def _lower(vertices: FloatArray, window: Window, points_w: FloatArray) -> None:
    """Lower the vertices of triangles that would hide points (p, 3) [m], because they leave samples of the map out."""
    count, place = CELLS + 1, (points_w[:, :2] - (window.x, window.y)) / window.spacing
    inside = (place >= 0.0).all(axis=1) & (place < CELLS).all(axis=1) & ~np.isnan(points_w[:, 2])
    cell = np.floor(place[inside]).astype(np.int64)
    u, v = (place[inside] - cell).T
    first = cell[:, 1] * count + cell[:, 0]
    corners = np.stack([first, first + np.where(u >= v, 1, count), first + count + 1], axis=1)
    weights = np.stack([1.0 - np.maximum(u, v), np.abs(u - v), np.minimum(u, v)], axis=1)
    above = (weights * vertices[corners, 2]).sum(axis=1) - (points_w[inside, 2] - LOWER)
    drop = np.zeros(len(vertices))
    np.maximum.at(drop, corners, np.maximum(np.nan_to_num(above), 0.0)[:, None])
    vertices[:, 2] -= drop


def _bounds(tile: MainMesh) -> FloatArray:
    """Return points (n, 2) [m] between which a tile lies."""
    if isinstance(tile, HeightMap):
        row, column = tile.geometry.last.tolist()
        return tile.geometry.to_world(np.array([0.0, 0.0, row, row]), np.array([0.0, column, 0.0, column]))
    return np.stack([tile.vertices[:, :2].min(axis=0), tile.vertices[:, :2].max(axis=0)])
