"""Rays onto a moving height map: a traversal of tiles and cells (Amanatides and Woo, *A Fast Voxel Traversal Algorithm
for Ray Tracing*, 1987).

The heights of one instant are computed tile by tile, when the first ray visits a tile, together with the tile's lowest
and highest height. A ray passes over or under a tile in one step if the tile's heights are out of its way. In a cell
the gap between ray and ground is linear on each side of the diagonal, so the ray meets the ground where the gap changes
its sign. The gap at the end of one facet is the gap at the start of the next, so that no ray slips through an edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.moving_grid import MovingGrid, to_grid, to_world
from smartmesh_ros.terrain.window_heights import read_heights

# Side of a tile [cells]. A larger one skips more ground in one step, and computes more heights that no ray needs.
TILE = 16
SIDE = TILE + 1  # samples along a side, including those shared with the next tile
# Distance from a tile's heights within which a ray is still checked [m], and from the map's edge [cells]: rounding.
CLOSE, EDGE = 1e-9, 1e-6


class RayTiles(NamedTuple):
    """Heights of a map at one instant, on its lattice with ``pad`` more samples on each side.

    ``heights`` (tiles, SIDE * SIDE) [m]; ``low``, ``high`` (tile rows, tile columns) [m]; valid where ``filled`` is 1.
    ``rim`` (4, n) [m]: heights of the padding below the first row, above the last one, left of the first column and
    right of the last one; its first element belongs to the corner. ``others`` (K, 6): position, cosine and sine of the
    yaw, width and depth [m] of the other tiles of the terrain, on which the padding does not count. ``window``: scratch
    memory (SIDE, SIDE).
    """

    heights: FloatArray
    low: FloatArray
    high: FloatArray
    filled: NDArray[np.uint8]
    pad: int
    rim: FloatArray
    others: FloatArray
    window: FloatArray


class GridRay(NamedTuple):
    """A ray in the lattice: row, column [samples] and height [m] at its start, and their changes per metre."""

    row: float
    column: float
    z: float
    rows: float
    columns: float
    rise: float


class Hit(NamedTuple):
    """``distance`` [m] along a ray, infinity = none, and the slope of the facet there per column and row [m]."""

    distance: float
    per_column: float
    per_row: float


MISS = Hit(math.inf, 0.0, 0.0)


@compiled
def cast_on_grid(
    grid: MovingGrid, tiles: RayTiles, time: float, origins: FloatArray, directions: FloatArray, reach: float,
    distances: FloatArray, normals: FloatArray,
) -> None:  # fmt: skip
    """Write ``distances`` (N,) [m] and ``normals`` (N, 3) of the rays that meet a map at ``time`` [s] within ``reach``
    [m] and before their distance so far.

    ``origins`` (N, 3) [m]; ``directions`` (N, 3): unit vectors.
    """
    for i in range(len(origins)):
        row, column = to_grid(grid, origins[i, 0], origins[i, 1])
        dx, dy = directions[i, 0] / grid.resolution, directions[i, 1] / grid.resolution
        ray = GridRay(
            row + tiles.pad, column + tiles.pad, origins[i, 2], dy * grid.cos - dx * grid.sin,
            dx * grid.cos + dy * grid.sin, directions[i, 2],
        )  # fmt: skip
        hit = cast_ray(grid, tiles, time, ray, min(reach, distances[i]))
        if hit.distance < distances[i]:
            distances[i] = hit.distance
            east, north = -hit.per_column / grid.resolution, -hit.per_row / grid.resolution
            up = 1.0 / math.sqrt(1.0 + east * east + north * north)
            normals[i, 0] = (east * grid.cos - north * grid.sin) * up
            normals[i, 1] = (east * grid.sin + north * grid.cos) * up
            normals[i, 2] = up


@compiled
def cast_ray(grid: MovingGrid, tiles: RayTiles, time: float, ray: GridRay, reach: float) -> Hit:
    """Return the first hit of a ray within ``reach`` [m]."""
    rows, columns = grid.heights.shape
    last_row, last_column = rows - 1 + 2 * tiles.pad, columns - 1 + 2 * tiles.pad
    begin, end = clipped(ray.row, ray.rows, last_row, 0.0, reach)
    begin, end = clipped(ray.column, ray.columns, last_column, begin, end)
    if begin > end:
        return MISS
    tile_row = cell_at(ray.row + ray.rows * begin, 0, last_row) // TILE
    tile_column = cell_at(ray.column + ray.columns * begin, 0, last_column) // TILE
    while 0 <= tile_row < tiles.low.shape[0] and 0 <= tile_column < tiles.low.shape[1]:
        leave_row = leaves(ray.row, ray.rows, tile_row * TILE, (tile_row + 1) * TILE)
        leave_column = leaves(ray.column, ray.columns, tile_column * TILE, (tile_column + 1) * TILE)
        leave = max(min(leave_row, leave_column, end), begin)
        if not tiles.filled[tile_row, tile_column]:
            fill(grid, tiles, time, tile_row, tile_column)
        first, last = ray.z + ray.rise * begin, ray.z + ray.rise * leave
        low, high = tiles.low[tile_row, tile_column] - CLOSE, tiles.high[tile_row, tile_column] + CLOSE
        if min(first, last) <= high and max(first, last) >= low:
            hit = cast_in_tile(grid, tiles, ray, tile_row, tile_column, begin, leave)
            if hit.distance <= reach:
                return hit
        if leave >= end:
            break
        begin = leave
        if leave_row <= leave_column:
            tile_row += 1 if ray.rows > 0.0 else -1
        if leave_column <= leave_row:
            tile_column += 1 if ray.columns > 0.0 else -1
    return MISS


@compiled
def clipped(start: float, rate: float, last: int, begin: float, end: float) -> tuple[float, float]:
    """Return the part of a ray, from ``begin`` to ``end`` [m], in which a coordinate is between 0 and ``last``."""
    if rate == 0.0:
        return (begin, end) if -EDGE <= start <= last + EDGE else (math.inf, -math.inf)
    first, second = (-EDGE - start) / rate, (last + EDGE - start) / rate
    return max(begin, min(first, second)), min(end, max(first, second))


@compiled
def cell_at(position: float, first: int, last: int) -> int:
    """Return the cell at a position, from ``first`` to the one before ``last``."""
    return int(min(max(math.floor(position), first), last - 1))


@compiled
def leaves(start: float, rate: float, low: int, high: int) -> float:
    """Return the distance [m] at which a coordinate leaves the range from ``low`` to ``high``."""
    if rate > 0.0:
        return (high - start) / rate
    if rate < 0.0:
        return (low - start) / rate
    return math.inf


@compiled
def fill(grid: MovingGrid, tiles: RayTiles, time: float, tile_row: int, tile_column: int) -> None:
    """Compute the heights of a tile at ``time`` [s], and their range."""
    rows, columns = grid.heights.shape
    row, column = tile_row * TILE - tiles.pad, tile_column * TILE - tiles.pad
    window = tiles.window
    read_heights(grid, row, column, time, window)
    index, k = tile_row * tiles.low.shape[1] + tile_column, 0
    low, high = math.inf, -math.inf
    for a in range(SIDE):
        for b in range(SIDE):
            z = window[a, b]
            if tiles.pad == 1:
                r, c = row + a, column + b
                if r == -1 and c <= columns:
                    z = tiles.rim[0, c + 1]
                elif r == rows and c <= columns:
                    z = tiles.rim[1, c + 1]
                elif c == -1 and r <= rows:
                    z = tiles.rim[2, r + 1]
                elif c == columns and r <= rows:
                    z = tiles.rim[3, r + 1]
            tiles.heights[index, k] = z
            k += 1
            if z < low:
                low = z
            if z > high:
                high = z
    tiles.low[tile_row, tile_column], tiles.high[tile_row, tile_column] = low, high
    tiles.filled[tile_row, tile_column] = 1


@compiled
def cast_in_tile(
    grid: MovingGrid, tiles: RayTiles, ray: GridRay, tile_row: int, tile_column: int, begin: float, end: float
) -> Hit:
    """Return the first hit of a ray in a tile between the distances ``begin`` and ``end`` [m]."""
    first_row, first_column = tile_row * TILE, tile_column * TILE
    rows, columns = grid.heights.shape
    end_row = min(first_row + TILE, rows - 1 + 2 * tiles.pad)
    end_column = min(first_column + TILE, columns - 1 + 2 * tiles.pad)
    heights = tiles.heights[tile_row * tiles.low.shape[1] + tile_column]
    row = cell_at(ray.row + ray.rows * begin, first_row, end_row)
    column = cell_at(ray.column + ray.columns * begin, first_column, end_column)
    across = ray.columns - ray.rows
    gap, s = math.nan, begin
    while first_row <= row < end_row and first_column <= column < end_column:
        leave_row = leaves(ray.row, ray.rows, row, row + 1)
        leave_column = leaves(ray.column, ray.columns, column, column + 1)
        leave = max(min(leave_row, leave_column, end), s)
        at = (row - first_row) * SIDE + column - first_column
        near, far = heights[at], heights[at + SIDE + 1]
        right, above = heights[at + 1], heights[at + SIDE]
        diagonal = ((ray.row - row) - (ray.column - column)) / across if across != 0.0 else leave
        for part in range(2):
            stop = min(max(diagonal, s), leave) if part == 0 else leave
            if stop > s:
                middle = 0.5 * (s + stop)
                upper = (ray.row - row) + ray.rows * middle > (ray.column - column) + ray.columns * middle
                per_column, per_row = (far - above, above - near) if upper else (right - near, far - right)
                gap, hit = crossing(ray, near, per_column, per_row, row, column, s, stop, gap)
                if hit <= end and counts(grid, tiles, ray, row, column, hit):
                    return Hit(hit, per_column, per_row)
                s = stop
        if leave >= end:
            break
        if leave_row <= leave_column:
            row += 1 if ray.rows > 0.0 else -1
        if leave_column <= leave_row:
            column += 1 if ray.columns > 0.0 else -1
    return MISS


@compiled
def crossing(
    ray: GridRay, near: float, per_column: float, per_row: float, row: int, column: int, begin: float, end: float,
    gap: float,
) -> tuple[float, float]:  # fmt: skip
    """Return the gap [m] between ray and facet at the distance ``end``, NaN over a hole, and the distance at which the
    ray meets the facet, infinity if it does not.

    ``gap``: at the end of the facet before, NaN = there was none.
    """
    if math.isnan(gap):
        gap = gap_at(ray, near, per_column, per_row, row, column, begin)
    after = gap_at(ray, near, per_column, per_row, row, column, end)
    if gap == 0.0:
        return after, begin
    if (gap > 0.0 and after <= 0.0) or (gap < 0.0 and after >= 0.0):
        return after, begin + (end - begin) * gap / (gap - after)
    return after, math.inf


@compiled
def gap_at(ray: GridRay, near: float, per_column: float, per_row: float, row: int, column: int, s: float) -> float:
    """Return the height [m] of a ray above the plane of a facet at the distance ``s`` [m]."""
    v, u = (ray.row - row) + ray.rows * s, (ray.column - column) + ray.columns * s
    return ray.z + ray.rise * s - (near + u * per_column + v * per_row)


@compiled
def counts(grid: MovingGrid, tiles: RayTiles, ray: GridRay, row: int, column: int, s: float) -> bool:
    """Return True unless a hit is on the padding and another tile covers its place."""
    rows, columns = grid.heights.shape
    pad = tiles.pad
    if pad == 0 or (pad <= row < rows - 1 + pad and pad <= column < columns - 1 + pad):
        return True
    x, y = to_world(grid, ray.row + ray.rows * s - pad, ray.column + ray.columns * s - pad)
    for k in range(len(tiles.others)):
        other_x, other_y, cos, sin, wide, deep = tiles.others[k]
        across, along = x - other_x, y - other_y
        if 0.0 <= across * cos + along * sin <= wide and 0.0 <= along * cos - across * sin <= deep:
            return False
    return True
