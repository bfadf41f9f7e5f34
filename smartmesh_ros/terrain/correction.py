"""Corrections of static ground: new estimates of its heights, blended in over a short time.

A correction has no velocity. The shown heights change linearly from the old estimate to the new one. The caller that
steps the physics sets the instant, so that the ground, its colliders and the bodies on it move together.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled

# Side of the square blocks of samples that share one clock [samples], a power of two, and its exponent.
BLOCK_SHIFT = 6
BLOCK = 1 << BLOCK_SHIFT


@compiled
def remaining(clock, shown, settle):
    """Return the fraction of a block's correction that is not yet blended in at the instant ``shown`` [s]."""
    elapsed = shown - clock.middle
    if not elapsed < settle:
        return 0.0
    return 1.0 - max(elapsed, 0.0) / settle


@compiled
def take_corrected(
    heights: NDArray[np.float32], offsets: NDArray[np.float32], clocks: Any, row: int, column: int,
    new: NDArray[np.float32], time: float, shown: float, settle: float,
) -> None:  # fmt: skip
    """Write ``new`` heights (h, w) [m] of ``time`` [s] to the rectangle whose first sample is (``row``, ``column``).

    ``offsets`` [m] are set so that the shown heights do not jump at the instant ``shown`` [s], inf = nothing shown yet.
    A filled hole takes the offset of the sample before it in its row, because a different offset would be a spike.
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
            clock.updates += 1
