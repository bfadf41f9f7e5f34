"""The smallest rectangle of samples that contains all contact candidates, at the coarsest stride within the
tolerance."""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.contact_candidates import Candidates, Window
from smartmesh_ros.terrain.moving_grid import triangle_weights

# Allowed numbers of cells on a side of a rectangle. Few sizes let colliders be reused, because a collider cannot change
# its size.
SIZES = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
# Strides, coarsest first [samples].
STRIDES = (16, 8, 4, 2, 1)
# A body keeps a rectangle with up to this multiple of the cells it needs. Raising the ratio replaces colliders less
# often, but makes them larger.
SHRINK_RATIO = 3.0


class Rectangle(NamedTuple):
    """First sample (``row``, ``column``) in a window, ``high`` x ``wide`` cells of ``stride`` samples each, and
    ``deviation`` [m], a bound on the distance between its surface and the ground over the contact candidates."""

    row: int
    column: int
    high: int
    wide: int
    stride: int
    deviation: float


@compiled
def next_size(cells: int) -> int:
    """The smallest allowed size of at least ``cells`` cells."""
    for size in SIZES:
        if size >= cells:
            return size
    return cells


@compiled
def stride_deviation(
    window: Window, candidates: Candidates, row: int, column: int, high: int, wide: int, stride: int
) -> float:
    """Largest vertical distance between a rectangle's surface and the ground over the candidate cells [m]; infinite if
    the rectangle leaves the window. Only samples are compared: ground cells lie within the rectangle's cells, so the
    distance is largest at a sample."""
    rows, columns = window.heights.shape
    if stride == 1:
        return 0.0
    if row < 0 or column < 0 or row + high * stride >= rows or column + wide * stride >= columns:
        return math.inf
    worst = 0.0
    for a in range(candidates.top, candidates.bottom + 2):
        for b in range(candidates.left, candidates.right + 2):
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
    """First sample of a side of ``total`` samples, centred on the ``need`` samples from ``first`` on, and clamped to
    the bounds ``least`` to ``most`` if it fits between them."""
    start = first - (total - need) // 2
    return max(min(start, most - total), least) if most - least >= total else start


@compiled
def placed(
    window: Window, candidates: Candidates, high: int, wide: int, stride: int, bounds: tuple[int, int, int, int]
) -> Rectangle:
    """Return a rectangle of ``high`` x ``wide`` cells centred on the candidate cells, and clamped to ``bounds`` (first
    and last row, first and last column) if it fits."""
    row = start_of(candidates.top, candidates.bottom - candidates.top + 1, high * stride, bounds[0], bounds[1])
    column = start_of(candidates.left, candidates.right - candidates.left + 1, wide * stride, bounds[2], bounds[3])
    return Rectangle(
        row, column, high, wide, stride, stride_deviation(window, candidates, row, column, high, wide, stride)
    )


@compiled
def holds(rectangle: Rectangle, candidates: Candidates) -> bool:
    """Return True if a rectangle contains all candidate cells."""
    last_row = rectangle.row + rectangle.high * rectangle.stride
    last_column = rectangle.column + rectangle.wide * rectangle.stride
    return (
        rectangle.row <= candidates.top
        and last_row > candidates.bottom
        and rectangle.column <= candidates.left
        and last_column > candidates.right
    )


@compiled
def cells_needed(candidates: Candidates, stride: int) -> tuple[int, int]:
    """Number of cells of a stride that cover the candidate cells, along rows and along columns."""
    high, wide = candidates.bottom - candidates.top + 1, candidates.right - candidates.left + 1
    return next_size((high + stride - 1) // stride), next_size((wide + stride - 1) // stride)


@compiled
def smallest_rectangle(
    window: Window,
    candidates: Candidates,
    before: Rectangle,
    tolerance: float,
    most: int,
    bounds: tuple[int, int, int, int],
) -> Rectangle:
    """Return the rectangle for a body's candidates. The previous one, ``before`` (``high`` 0 = none), is reused if it
    still contains them within the ``tolerance`` [m]. A rectangle has at most ``most`` cells; if only strides beyond the
    tolerance allow this, the finest of these strides is used."""
    if before.high > 0:
        high, wide = cells_needed(candidates, before.stride)
        if before.high * before.wide <= SHRINK_RATIO * high * wide:
            if holds(before, candidates):
                off = stride_deviation(
                    window, candidates, before.row, before.column, before.high, before.wide, before.stride
                )
                if off <= tolerance:
                    return Rectangle(before.row, before.column, before.high, before.wide, before.stride, off)
            if before.high >= high and before.wide >= wide:
                moved = placed(window, candidates, before.high, before.wide, before.stride, bounds)
                if moved.deviation <= tolerance:
                    return moved
    for stride in STRIDES:
        high, wide = cells_needed(candidates, stride)
        if stride > 1 and max(candidates.bottom - candidates.top, candidates.right - candidates.left) + 1 <= stride:
            continue  # half the stride needs no more cells
        if high * wide <= most:
            found = placed(window, candidates, high, wide, stride, bounds)
            if found.deviation <= tolerance:
                return found
    stride = 1
    high, wide = cells_needed(candidates, stride)
    while high * wide > most:
        stride *= 2
        high, wide = cells_needed(candidates, stride)
    return placed(window, candidates, high, wide, stride, bounds)
