"""Ground that stands still and is known better now: corrections of its heights, worked off over a short time.

A correction has no velocity. What was shown before becomes what is known now in a straight line; whoever steps the
physics says up to which instant, so that the ground, its colliders and the bodies on it are moved together.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled

# Side of the square blocks of samples that share a clock, as a power of two [samples].
BLOCK_SHIFT = 6
BLOCK = 1 << BLOCK_SHIFT


@compiled
def remaining(clock, shown, settle):
    """Share of a block's corrections that is still to be worked off at the instant ``shown`` [s]."""
    elapsed = shown - clock.middle
    if not elapsed < settle:
        return 0.0
    return 1.0 - max(elapsed, 0.0) / settle


@compiled
def take_corrected(
    heights: NDArray[np.float32], offsets: NDArray[np.float32], clocks: Any, row: int, column: int,
    new: NDArray[np.float32], time: float, shown: float, settle: float,
) -> None:  # fmt: skip
    """Takes ``new`` heights (h, w) [m] at ``time`` [s] for the rectangle whose first sample is (``row``, ``column``);
    ``offsets`` keep what is shown at the instant ``shown`` [s], inf = nothing is shown yet.

    A hole that is filled goes with the last sample before it in its row, so that it is no spike among those.
    """
    rows, columns = heights.shape
    high, wide = new.shape
    for block_row in range(row >> BLOCK_SHIFT, ((row + high - 1) >> BLOCK_SHIFT) + 1):
        for block_column in range(column >> BLOCK_SHIFT, ((column + wide - 1) >> BLOCK_SHIFT) + 1):
            clock = clocks[block_row, block_column]
            left = np.float32(remaining(clock, shown, settle))
            first_row, first_column = block_row << BLOCK_SHIFT, block_column << BLOCK_SHIFT
            last_row, last_column = min(first_row + BLOCK, rows), min(first_column + BLOCK, columns)
            for r in range(first_row, last_row):
                before = np.float32(0.0)
                for c in range(first_column, last_column):
                    offset = left * offsets[r, c]
                    if row <= r < row + high and column <= c < column + wide:
                        known = new[r - row, c - column]
                        offset = heights[r, c] + offset - known
                        if shown == math.inf or math.isnan(known):
                            offset = np.float32(0.0)
                        elif math.isnan(offset):
                            offset = before
                        heights[r, c] = known
                        before = offset
                    offsets[r, c] = offset
            clock.middle = time if shown == math.inf else shown
            clock.time, clock.known, clock.lifetime = time, 0, 0.0
