"""Updates of a height map: storing new heights and estimating velocities from them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.correction import BLOCK, BLOCK_SHIFT
from smartmesh_ros.terrain.motion import INTERVALS_KEPT, KEPT

# Method of computing the newest velocities of a block. UNCHANGED: keep them. DIFFERENCE: difference quotient of the
# heights. CORRECTION: add the difference quotient of a correction. MERGED: difference quotient over the last intervals
# as one. GIVEN: copy the given velocities.
UNCHANGED, DIFFERENCE, CORRECTION, MERGED, GIVEN = 0, 1, 2, 3, 4
# Minimum interval for a velocity of its own, as a fraction of the usual interval. Sooner updates are merged with the
# interval before, because a short interval amplifies jitter and noise.
MIN_INTERVAL_SHARE = 0.5


class VelocityUpdate(NamedTuple):
    """Coefficients of a velocity update: ``keep`` [-] x old velocity + ``inverse`` [1/s] x difference of heights.

    ``method``: one of the constants above.
    """

    method: int
    inverse: float
    keep: float


@compiled
def usual_interval(clock):
    """Return the mean of the last update intervals [s], zero if there are none.

    The mean is the same for bursts as for evenly spaced updates; the median would be the interval within a burst.
    """
    total = 0.0
    for k in range(clock.count):
        total += clock.intervals[k]
    return total / clock.count if clock.count > 0 else 0.0


@compiled
def note_interval(clock, since):
    """Store the time ``since`` the last update [s]; the longest stored interval becomes the expected one."""
    for k in range(min(clock.count, INTERVALS_KEPT - 1), 0, -1):
        clock.intervals[k] = clock.intervals[k - 1]
    clock.intervals[0] = since
    clock.count = min(clock.count + 1, INTERVALS_KEPT)
    clock.lifetime = 0.0
    for k in range(clock.count):
        clock.lifetime = max(clock.lifetime, clock.intervals[k])


@compiled
def note_update(clock, time, given, whole, min_interval, max_interval):
    """Store an update at ``time`` [s] in a block's ``clock``; return its `VelocityUpdate`.

    ``given``: the update contains velocities. ``whole``: it covers the whole block.
    """
    clock.updates += 1
    since = time - clock.time
    again = since == 0.0 or (0.0 < since < min_interval and not whole)
    recent = not again and 0.0 < since <= max_interval
    differs = clock.known > 0 and clock.middle < clock.time
    if again and not given:
        return (
            VelocityUpdate(CORRECTION, 0.5 / (clock.time - clock.middle), 1.0)
            if differs
            else VelocityUpdate(UNCHANGED, 0.0, 0.0)
        )
    if again and clock.known > 0:
        return VelocityUpdate(GIVEN, 0.0, 0.0)
    before, clock.time = clock.time, time
    parts = recent and time - clock.opened < min_interval
    if parts and not given and clock.known == 0:
        return VelocityUpdate(UNCHANGED, 0.0, 0.0)
    if not (given or recent):
        clock.opened, clock.known, clock.lifetime, clock.count = time, 0, 0.0, 0
        return VelocityUpdate(UNCHANGED, 0.0, 0.0)
    if recent and not given and differs and (parts or since < MIN_INTERVAL_SHARE * usual_interval(clock)):
        note_interval(clock, since)
        span = 2.0 * (before - clock.middle) + since
        clock.middle = time - 0.5 * span
        return VelocityUpdate(MERGED, 1.0 / span, 1.0 - since / span)
    clock.opened = time
    clock.newest = (clock.newest + 1) % KEPT
    clock.middle_2, clock.middle_1 = clock.middle_1, clock.middle
    clock.middle = time if given else time - 0.5 * since
    clock.known = min(clock.known + 1, KEPT) if recent else 1
    if recent:
        note_interval(clock, since)
    else:
        clock.lifetime, clock.count = max_interval, 0
    return VelocityUpdate(GIVEN, 0.0, 0.0) if given else VelocityUpdate(DIFFERENCE, 1.0 / since, 0.0)


@compiled
def write_velocities(velocities, heights, new, given, method, inverse, keep):
    """Write the velocities of a part of a row, all (n,)."""
    for c in range(len(new)):
        if method == DIFFERENCE:
            velocities[c] = (new[c] - heights[c]) * inverse
        elif method == CORRECTION:
            velocities[c] += (new[c] - heights[c]) * inverse
        elif method == MERGED:
            velocities[c] = velocities[c] * keep + (new[c] - heights[c]) * inverse
        elif method == GIVEN:
            velocities[c] = given[c]


@compiled
def scale(velocities, newest, r, first, end, by):
    """Multiply the velocities of the samples ``first`` to ``end`` - 1 of a row by a factor; zero also ends NaN."""
    for c in range(first, end):
        velocities[newest, r, c] = velocities[newest, r, c] * by if by != 0.0 else by


@compiled
def samples_in(rectangles, rows, columns):
    """Return the number of samples in ``rectangles`` (n, 4); -1 if one is empty or leaves a map of (``rows``,
    ``columns``) samples."""
    count = 0
    for k in range(len(rectangles)):
        top, left, bottom, right = rectangles[k, 0], rectangles[k, 1], rectangles[k, 2], rectangles[k, 3]
        if not (0 <= top <= bottom < rows and 0 <= left <= right < columns):
            return -1
        count += (bottom - top + 1) * (right - left + 1)
    return count


@compiled
def take_rectangles(heights, velocities, clocks, rectangles, new, given, time, min_interval, max_interval):
    """Write ``new`` heights and ``given`` velocities (N,) as `take_heights`: those of one of the ``rectangles`` (n, 4)
    after the other, each row by row. A rectangle is its first row and column, last row and column."""
    start = 0
    for k in range(len(rectangles)):
        top, left, bottom, right = rectangles[k, 0], rectangles[k, 1], rectangles[k, 2], rectangles[k, 3]
        shape = bottom - top + 1, right - left + 1
        end = start + shape[0] * shape[1]
        take_heights(
            heights, velocities, clocks, top, left, new[start:end].reshape(shape), given[start:end].reshape(shape),
            time, min_interval, max_interval,
        )  # fmt: skip
        start = end


@compiled
def take_heights(heights, velocities, clocks, row, column, new, given, time, min_interval, max_interval):
    """Write ``new`` heights (h, w) [m] of ``time`` [s] to the rectangle whose first sample is (``row``, ``column``).

    Velocities are difference quotients, or ``given`` (h, w) [m/s], shape (0, 0) = not given. They are written to the
    ring buffer. Other samples of the touched blocks are at rest for that interval. An update of a part of a block less
    than ``min_interval`` [s] after the last one corrects it: the difference quotient is added to the velocity. An
    update so soon, or soon compared to the intervals before (`MIN_INTERVAL_SHARE`), is merged: the newest velocity then
    is the mean over both intervals. The loop runs row by row, in memory order.
    """
    rows, columns = heights.shape
    end_row, end_column = row + new.shape[0], column + new.shape[1]
    first_block, end_block = column >> BLOCK_SHIFT, ((end_column - 1) >> BLOCK_SHIFT) + 1
    methods, inverse, keep = (
        np.empty(end_block, np.int64),
        np.empty(end_block, np.float32),
        np.empty(end_block, np.float32),
    )
    for block_row in range(row >> BLOCK_SHIFT, ((end_row - 1) >> BLOCK_SHIFT) + 1):
        for block in range(first_block, end_block):
            top, side = block_row << BLOCK_SHIFT, block << BLOCK_SHIFT
            whole = row <= top and column <= side
            whole = whole and end_row >= min(top + BLOCK, rows) and end_column >= min(side + BLOCK, columns)
            methods[block], inverse[block], keep[block] = note_update(
                clocks[block_row, block], time, given.size > 0, whole, min_interval, max_interval
            )
        for r in range(block_row << BLOCK_SHIFT, min((block_row + 1) << BLOCK_SHIFT, rows)):
            inside = row <= r < end_row
            for block in range(first_block, end_block):
                first, last = block << BLOCK_SHIFT, min((block << BLOCK_SHIFT) + BLOCK, columns)
                left, right = (max(first, column), min(last, end_column)) if inside else (last, last)
                newest = clocks[block_row, block].newest
                if methods[block] == DIFFERENCE or methods[block] == GIVEN:
                    scale(velocities, newest, r, first, left, np.float32(0.0))
                    scale(velocities, newest, r, right, last, np.float32(0.0))
                elif methods[block] == MERGED:
                    scale(velocities, newest, r, first, left, keep[block])
                    scale(velocities, newest, r, right, last, keep[block])
                if left < right:
                    fresh = new[r - row, left - column : right - column]
                    stated = given[r - row, left - column : right - column] if given.size > 0 else fresh
                    write_velocities(
                        velocities[newest, r, left:right], heights[r, left:right], fresh, stated, methods[block],
                        inverse[block], keep[block],
                    )  # fmt: skip
                    heights[r, left:right] = fresh
