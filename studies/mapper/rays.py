"""Rays cast onto the triangulated surface of a height map: exact, compiled.

A ray goes from cell to cell. Each cell is two triangles, cut along the diagonal from (row, column) to (row + 1,
column + 1) as everywhere in the project. So along the ray the gap above the ground is a straight line up to the
diagonal and another one behind it: the ray meets the ground where one of them crosses zero.
"""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.evaluation.distance import Surface
from smartmesh_ros.terrain.grid import FloatArray


def cast_rays(surface: Surface, start_w: FloatArray, directions_w: FloatArray, reach: float) -> FloatArray:
    """Distance (N,) [m] from ``start_w`` (3,) [m], above the ground, to the ground along unit ``directions_w`` (N, 3).

    NaN where none is met within ``reach`` [m] and inside the map, which may not be turned. Rays go through holes.
    """
    geometry = surface.geometry
    start = (np.asarray(start_w, np.float64) - geometry.origin) / (geometry.resolution, geometry.resolution, 1.0)
    directions = np.asarray(directions_w, np.float64) / (geometry.resolution, geometry.resolution, 1.0)
    heights = np.ascontiguousarray(surface.heights, np.float64)
    ranges = np.empty(len(directions))
    _cast_all(heights, float(np.nanmax(heights)), start, directions, reach, ranges)
    return ranges


@compiled
def _cast_all(
    heights: FloatArray, highest: float, start: FloatArray, directions: FloatArray, reach: float, ranges: FloatArray
) -> None:
    for k in range(len(directions)):
        dx, dy, dz = directions[k]
        ranges[k] = _cast(heights, highest, start[0], start[1], start[2], dx, dy, dz, reach)


@compiled
def _cast(
    heights: FloatArray, highest: float, x: float, y: float, z: float, dx: float, dy: float, dz: float, reach: float
) -> float:
    """Distance along the ray (x + dx s, y + dy s, z + dz s), x and y in samples; NaN = nothing met."""
    rows, columns = heights.shape
    row, column = math.floor(y), math.floor(x)
    s = 0.0
    while 0 <= row < rows - 1 and 0 <= column < columns - 1 and s < reach:
        if dz >= 0.0 and z + dz * s > highest:
            break
        leave_x, leave_y = _leaves(x, dx, column), _leaves(y, dy, row)
        leave = min(leave_x, leave_y, reach)
        # On the diagonal x - column == y - row.
        across = dx - dy
        diagonal = ((y - row) - (x - column)) / across if across != 0.0 else leave
        if s < diagonal < leave:
            hit: float = _crossing(heights, row, column, x, y, z, dx, dy, dz, s, diagonal)
            if hit == hit:
                return hit
            s = diagonal
        hit = _crossing(heights, row, column, x, y, z, dx, dy, dz, s, leave)
        if hit == hit:
            return hit
        s = leave
        if leave_x <= leave_y:
            column += 1 if dx > 0.0 else -1
        if leave_y <= leave_x:
            row += 1 if dy > 0.0 else -1
    return math.nan


@compiled
def _leaves(start: float, rate: float, cell: int) -> float:
    """Where along the ray one coordinate leaves its cell."""
    if rate > 0.0:
        return (cell + 1 - start) / rate
    if rate < 0.0:
        return (cell - start) / rate
    return math.inf


@compiled
def _crossing(
    heights: FloatArray,
    row: int,
    column: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    begin: float,
    end: float,
) -> float:
    """Where between ``begin`` and ``end``, in one triangle of a cell, the ray goes into the ground; NaN = nowhere."""
    middle = 0.5 * (begin + end)
    lower = x + dx * middle - column >= y + dy * middle - row
    first: float = z + dz * begin - _height(heights, row, column, x + dx * begin, y + dy * begin, lower)
    last: float = z + dz * end - _height(heights, row, column, x + dx * end, y + dy * end, lower)
    if not last <= 0.0:
        return math.nan
    if first <= 0.0:
        return begin
    return begin + (end - begin) * first / (first - last)


@compiled
def _height(heights: FloatArray, row: int, column: int, x: float, y: float, lower: bool) -> float:
    """Height at (x, y) [samples] of a cell's lower triangle, of higher columns, or of its upper one."""
    u, v = x - column, y - row
    near: float = heights[row, column]
    far: float = heights[row + 1, column + 1]
    if lower:
        right: float = heights[row, column + 1]
        return near + u * (right - near) + v * (far - right)
    above: float = heights[row + 1, column]
    return near + v * (above - near) + u * (far - above)
