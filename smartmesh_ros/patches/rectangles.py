"""The smallest rectangle of samples that holds what a body can touch, at the coarsest stride that is near enough."""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.touchable import Touch, Window
from smartmesh_ros.terrain.moving_grid import triangle_weights

# Cells on a side of a rectangle; few sizes, because a collider cannot change its own.
SIZES = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
# Strides, coarsest first [samples].
STRIDES = (16, 8, 4, 2, 1)
# A body keeps the size it has while that has no more cells than this multiple of what it needs.
ROOM = 3.0


class Rectangle(NamedTuple):
    """First sample (``row``, ``column``) in a window, cells ``high`` x ``wide`` of ``stride`` samples each, and how far
    its surface lies from the ground where it can be touched [m]."""

    row: int
    column: int
    high: int
    wide: int
    stride: int
    deviation: float


@compiled
def next_size(cells: int) -> int:
    """The smallest size that has room for so many cells."""
    for size in SIZES:
        if size >= cells:
            return size
    return cells


@compiled
def stride_deviation(window: Window, touch: Touch, row: int, column: int, high: int, wide: int, stride: int) -> float:
    """How far a rectangle's surface lies from the ground over the touchable cells, vertically [m], at most; infinite
    where it leaves the window. The cells of the ground lie within its cells, so they differ most at samples."""
    rows, columns = window.heights.shape
    if stride == 1:
        return 0.0
    if row < 0 or column < 0 or row + high * stride >= rows or column + wide * stride >= columns:
        return math.inf
    worst = 0.0
    for a in range(touch.top, touch.bottom + 2):
        for b in range(touch.left, touch.right + 2):
            z = window.heights[a, b]
            r, c, v, u, upper = triangle_weights((a - row) / stride, (b - column) / stride, high + 1, wide + 1)
            r, c = row + r * stride, column + c * stride
            side_r, side_c = (r + stride, c) if upper == 1 else (r, c + stride)
            surface = (
                (1.0 - max(u, v)) * window.heights[r, c]
                + abs(u - v) * window.heights[side_r, side_c]
                + min(u, v) * window.heights[r + stride, c + stride]
            )
            off = abs(surface - z)
            if math.isnan(off):
                return math.inf
            worst = max(worst, off)
    return worst


@compiled
def start_of(first: int, need: int, total: int, least: int, most: int) -> int:
    """Where a side of ``total`` samples starts that holds ``need`` from ``first`` on, in its middle but within
    ``least`` to ``most`` if there is room."""
    start = first - (total - need) // 2
    return max(min(start, most - total), least) if most - least >= total else start


@compiled
def placed(
    window: Window, touch: Touch, high: int, wide: int, stride: int, bounds: tuple[int, int, int, int]
) -> Rectangle:
    """A rectangle of ``high`` x ``wide`` cells around the touchable ones, within ``bounds`` (first and last row, first
    and last column) where these have room."""
    row = start_of(touch.top, touch.bottom - touch.top + 1, high * stride, bounds[0], bounds[1])
    column = start_of(touch.left, touch.right - touch.left + 1, wide * stride, bounds[2], bounds[3])
    return Rectangle(row, column, high, wide, stride, stride_deviation(window, touch, row, column, high, wide, stride))


@compiled
def holds(rectangle: Rectangle, touch: Touch) -> bool:
    """Whether a rectangle holds all touchable cells."""
    last_row = rectangle.row + rectangle.high * rectangle.stride
    last_column = rectangle.column + rectangle.wide * rectangle.stride
    return (
        rectangle.row <= touch.top
        and last_row > touch.bottom
        and rectangle.column <= touch.left
        and last_column > touch.right
    )


@compiled
def cells_needed(touch: Touch, stride: int) -> tuple[int, int]:
    """Cells of a stride that the touchable ones need, along rows and along columns."""
    high, wide = touch.bottom - touch.top + 1, touch.right - touch.left + 1
    return next_size((high + stride - 1) // stride), next_size((wide + stride - 1) // stride)


@compiled
def smallest_rectangle(
    window: Window, touch: Touch, before: Rectangle, tolerance: float, most: int, bounds: tuple[int, int, int, int]
) -> Rectangle:
    """The rectangle for what a body can touch; the one it had ``before`` (no cells = none) where that still holds it
    within the ``tolerance`` [m]. It has no more than ``most`` cells; where that leaves only strides that are not near
    enough, the finest of them."""
    if before.high > 0:
        high, wide = cells_needed(touch, before.stride)
        if before.high * before.wide <= ROOM * high * wide:
            if holds(before, touch):
                off = stride_deviation(
                    window, touch, before.row, before.column, before.high, before.wide, before.stride
                )
                if off <= tolerance:
                    return Rectangle(before.row, before.column, before.high, before.wide, before.stride, off)
            if before.high >= high and before.wide >= wide:
                moved = placed(window, touch, before.high, before.wide, before.stride, bounds)
                if moved.deviation <= tolerance:
                    return moved
    for stride in STRIDES:
        high, wide = cells_needed(touch, stride)
        if stride > 1 and max(touch.bottom - touch.top, touch.right - touch.left) + 1 <= stride:
            continue  # as many cells as with half of it
        if high * wide <= most:
            found = placed(window, touch, high, wide, stride, bounds)
            if found.deviation <= tolerance:
                return found
    stride = 1
    high, wide = cells_needed(touch, stride)
    while high * wide > most:
        stride *= 2
        high, wide = cells_needed(touch, stride)
    return placed(window, touch, high, wide, stride, bounds)
