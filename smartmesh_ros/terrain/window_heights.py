"""Heights of windows of a moving height map, without velocities, for compiled functions."""

from __future__ import annotations

import math

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.correction import BLOCK_SHIFT, remaining
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import KEPT, Mode, block_phase, displacement, motion_of
from smartmesh_ros.terrain.moving_grid import MovingGrid, motion_at


@compiled
def read_heights(grid: MovingGrid, row: int, column: int, time: float, out: FloatArray) -> None:
    """Write the heights (h, w) [m] at ``time`` [s] of a window that starts at sample (``row``, ``column``).

    NaN beyond the edge and in holes. Faster than `read_window`, because the samples of one block share a loop.
    """
    rows, columns = grid.heights.shape
    high, wide = out.shape
    out[:] = math.nan
    bottom, top, left, right = max(row, 0), min(row + high, rows), max(column, 0), min(column + wide, columns)
    for block_row in range(bottom >> BLOCK_SHIFT, ((top - 1) >> BLOCK_SHIFT) + 1):
        for block_column in range(left >> BLOCK_SHIFT, ((right - 1) >> BLOCK_SHIFT) + 1):
            r, c = max(bottom, block_row << BLOCK_SHIFT), max(left, block_column << BLOCK_SHIFT)
            end_r, end_c = min(top, (block_row + 1) << BLOCK_SHIFT), min(right, (block_column + 1) << BLOCK_SHIFT)
            if r < end_r and c < end_c:
                read_block(
                    grid, block_row, block_column, r, c, time, out[r - row : end_r - row, c - column : end_c - column]
                )


@compiled
def read_block(
    grid: MovingGrid, block_row: int, block_column: int, row: int, column: int, time: float, out: FloatArray
) -> None:
    """Write the heights (h, w) [m] of a window inside one block; see `read_heights`."""
    high, wide = out.shape
    clock, heights, base = grid.clocks[block_row, block_column], grid.heights, grid.z
    left, known = 0.0, clock.known
    if grid.mode == Mode.CORRECT:
        left, known = remaining(clock, grid.shown, grid.settle), 0
    for a in range(high):
        for b in range(wide):
            out[a, b] = base + float(heights[row + a, column + b])
    if left > 0.0:
        offsets = grid.offsets
        for a in range(high):
            for b in range(wide):
                out[a, b] += left * float(offsets[row + a, column + b])
    if known == 0:
        return
    phase = block_phase(clock, time, grid.mode)
    if phase.along == 0.0 and phase.bend == 0.0:
        return
    if grid.noise > 0.0:
        for a in range(high):
            for b in range(wide):
                velocity, acceleration = motion_at(grid, row + a, column + b, clock, phase)
                out[a, b] += displacement(velocity, acceleration, phase)
        return
    v, v1 = grid.velocities[clock.newest], grid.velocities[(clock.newest + KEPT - 1) % KEPT]
    v2, most = grid.velocities[(clock.newest + KEPT - 2) % KEPT], grid.max_velocity
    for a in range(high):
        for b in range(wide):
            r, c = row + a, column + b
            velocity, acceleration = motion_of(float(v[r, c]), float(v1[r, c]), float(v2[r, c]), phase, most)
            out[a, b] += displacement(velocity, acceleration, phase)
