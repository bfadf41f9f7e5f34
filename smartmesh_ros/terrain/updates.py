"""Taking new heights into a height map, and the velocities that they tell."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.correction import BLOCK, BLOCK_SHIFT
from smartmesh_ros.terrain.motion import KEPT

# How the newest velocities of a block are told: not at all, they stay; by the difference to the heights before; by a
# correction of these, which is added; or they are given.
STAY, DIFFERENCE, CORRECTION, GIVEN = 0, 1, 2, 3


@compiled
def note_update(clock, time, given, min_interval, max_interval):
    """Notes in a block's ``clock`` that it is updated at ``time`` [s], with velocities ``given`` or not; how its
    velocities are told, and what differences of heights are multiplied by for that [1/s]."""
    since = time - clock.time
    again = since == 0.0 or 0.0 < since < min_interval
    recent = not again and 0.0 < since <= max_interval
    if again and not given:
        if clock.known > 0 and clock.middle < clock.time:
            return CORRECTION, 0.5 / (clock.time - clock.middle)
        return STAY, 0.0
    if again and clock.known > 0:
        return GIVEN, 0.0
    clock.time = time
    if not (given or recent):
        clock.known, clock.lifetime = 0, 0.0
        return STAY, 0.0
    clock.newest = (clock.newest + 1) % KEPT
    clock.middle_2, clock.middle_1 = clock.middle_1, clock.middle
    clock.middle = time if given else time - 0.5 * since
    clock.known = min(clock.known + 1, KEPT) if recent else 1
    clock.lifetime = since if recent else max_interval
    return (GIVEN, 0.0) if given else (DIFFERENCE, 1.0 / since)


@compiled
def write_velocities(velocities, heights, new, given, told, inverse):
    """Writes the velocities that a row's part tells, all (n,)."""
    for c in range(len(new)):
        if told == DIFFERENCE:
            velocities[c] = (new[c] - heights[c]) * inverse
        elif told == CORRECTION:
            velocities[c] += (new[c] - heights[c]) * inverse
        elif told == GIVEN:
            velocities[c] = given[c]


@compiled
def take_heights(heights, velocities, clocks, row, column, new, given, time, min_interval, max_interval):
    """Takes ``new`` heights (h, w) [m] at ``time`` [s] for the rectangle whose first sample is (``row``, ``column``),
    and the velocities that they tell; ``given`` (h, w) [m/s] says them instead, (0, 0) = not given.

    Each block keeps its newest velocities in a ring. Samples that share a block with the rectangle but lie outside it
    are at rest. What comes less than ``min_interval`` [s] after the last is a correction of that instant: its
    difference is added to the velocity. Row by row, which reads memory in its order.
    """
    rows, columns = heights.shape
    end_row, end_column = row + new.shape[0], column + new.shape[1]
    first_block, end_block = column >> BLOCK_SHIFT, ((end_column - 1) >> BLOCK_SHIFT) + 1
    told, inverse = np.empty(end_block, np.int64), np.empty(end_block, np.float32)
    for block_row in range(row >> BLOCK_SHIFT, ((end_row - 1) >> BLOCK_SHIFT) + 1):
        for block in range(first_block, end_block):
            told[block], inverse[block] = note_update(
                clocks[block_row, block], time, given.size > 0, min_interval, max_interval
            )
        for r in range(block_row << BLOCK_SHIFT, min((block_row + 1) << BLOCK_SHIFT, rows)):
            inside = row <= r < end_row
            for block in range(first_block, end_block):
                first, last = block << BLOCK_SHIFT, min((block << BLOCK_SHIFT) + BLOCK, columns)
                left, right = (max(first, column), min(last, end_column)) if inside else (last, last)
                newest = velocities[clocks[block_row, block].newest, r]
                if told[block] == DIFFERENCE or told[block] == GIVEN:
                    newest[first:left] = 0.0
                    newest[right:last] = 0.0
                if left < right:
                    fresh = new[r - row, left - column : right - column]
                    says = given[r - row, left - column : right - column] if given.size > 0 else fresh
                    write_velocities(
                        newest[left:right], heights[r, left:right], fresh, says, told[block], inverse[block]
                    )
                    heights[r, left:right] = fresh
