"""Evaluation of a moving height map at an instant, for compiled functions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled, inlined
from smartmesh_ros.terrain.correction import BLOCK_SHIFT, remaining
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import AT_REST, KEPT, Mode, block_phase, displacement, motion_of, rise_of
from smartmesh_ros.terrain.noisy_motion import motion_in_noise, noise_variances

# A very short duration [s]. Instantaneous velocities are rises within it, divided by it.
INSTANT = 1e-9


class MovingGrid(NamedTuple):
    """Samples of a height map and their motion.

    ``heights`` (rows, columns) float32 [m], NaN = hole. ``velocities`` (KEPT, rows, columns) float32 [m/s]: a ring
    buffer, whose newest index is in the clock of each block. ``clocks``: records of ``CLOCK``, one per block.
    ``x``, ``y``, ``z`` [m]: position of sample (0, 0). ``cos``, ``sin``: of the grid's yaw. ``slide_x``, ``slide_y``
    [m/s]: horizontal velocity of the ground at sample (0, 0). ``spin`` [rad/s]: angular velocity of the grid about z.
    ``mode``, ``max_velocity``, ``settle``: see `MotionConfig`. ``offsets`` (rows, columns) float32 [m]: old minus new
    heights of corrections. ``shown`` [s]: instant up to which corrections are blended in. ``noise`` [m]: standard
    deviation of the heights for the estimation of velocities.
    """

    heights: NDArray[np.float32]
    velocities: NDArray[np.float32]
    clocks: NDArray[np.void]
    x: float
    y: float
    z: float
    cos: float
    sin: float
    resolution: float
    slide_x: float
    slide_y: float
    spin: float
    mode: int
    max_velocity: float
    offsets: NDArray[np.float32]
    shown: float
    settle: float
    noise: float


@compiled
def to_grid(grid: MovingGrid, x: float, y: float) -> tuple[float, float]:
    """Return the fractional row and column of a point [m]."""
    dx, dy = (x - grid.x) / grid.resolution, (y - grid.y) / grid.resolution
    return dy * grid.cos - dx * grid.sin, dx * grid.cos + dy * grid.sin


@compiled
def to_world(grid: MovingGrid, row: float, column: float) -> tuple[float, float]:
    """Return the position (x, y) [m] of a (fractional) sample."""
    u, v = column * grid.resolution, row * grid.resolution
    return grid.x + u * grid.cos - v * grid.sin, grid.y + u * grid.sin + v * grid.cos


@compiled
def slide_at(grid: MovingGrid, x: float, y: float) -> tuple[float, float]:
    """Return the horizontal velocity of the ground [m/s] at a point [m]."""
    return grid.slide_x - grid.spin * (y - grid.y), grid.slide_y + grid.spin * (x - grid.x)


@inlined
def sample_at(grid: MovingGrid, row: int, column: int, time: float, ahead: float) -> tuple[float, float]:
    """Return the height [m] of a sample at ``time`` [s], and its rise [m] within the time ``ahead`` [s].

    The height is NaN beyond the edge and in holes.
    """
    rows, columns = grid.heights.shape
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return math.nan, 0.0
    height = grid.z + float(grid.heights[row, column])
    clock = grid.clocks[row >> BLOCK_SHIFT, column >> BLOCK_SHIFT]
    if grid.mode == Mode.CORRECT:
        return height + remaining(clock, grid.shown, grid.settle) * float(grid.offsets[row, column]), 0.0
    if clock.known == 0:
        return height, 0.0
    phase = block_phase(clock, time, grid.mode)
    velocity, acceleration = motion_at(grid, row, column, clock, phase)
    return height + displacement(velocity, acceleration, phase), rise_of(velocity, acceleration, phase, ahead)


@inlined
def motion_at(grid, row, column, clock, phase):
    """Return the velocity [m/s] and acceleration [m/s^2] of a sample."""
    if grid.noise > 0.0:
        return motion_in_noise(grid, row, column, clock, phase, noise_variances(clock, grid.noise))
    v, newest = grid.velocities, clock.newest
    first, second = (newest + KEPT - 1) % KEPT, (newest + KEPT - 2) % KEPT
    return motion_of(
        float(v[newest, row, column]), float(v[first, row, column]), float(v[second, row, column]), phase,
        grid.max_velocity,
    )  # fmt: skip


@compiled
def read_window(
    grid: MovingGrid, row: int, column: int, stride: int, time: float, ahead: float, heights: FloatArray,
    rises: FloatArray,
) -> None:  # fmt: skip
    """Write ``heights`` (h, w) [m] at ``time`` [s] and ``rises`` (h, w) [m] within the time ``ahead`` [s] of a window.

    The window starts at sample (``row``, ``column``) and takes every ``stride``-th sample. Heights are NaN beyond the
    edge and in holes.
    """
    rows, columns = grid.heights.shape
    high, wide = heights.shape
    for a in range(high):
        r = row + a * stride
        block, known, left = -1, 0, 0.0
        clock, phase = grid.clocks[0, 0], AT_REST
        for b in range(wide):
            c = column + b * stride
            if r < 0 or c < 0 or r >= rows or c >= columns:
                heights[a, b], rises[a, b] = math.nan, 0.0
                continue
            if c >> BLOCK_SHIFT != block:
                block = c >> BLOCK_SHIFT
                clock = grid.clocks[r >> BLOCK_SHIFT, block]
                known = clock.known
                if grid.mode == Mode.CORRECT:
                    known, left = 0, remaining(clock, grid.shown, grid.settle)
                phase = block_phase(clock, time, grid.mode)
            height, rise = grid.z + float(grid.heights[r, c]), 0.0
            if known:
                velocity, acceleration = motion_at(grid, r, c, clock, phase)
                height += displacement(velocity, acceleration, phase)
                rise = rise_of(velocity, acceleration, phase, ahead)
            elif left > 0.0:
                height += left * float(grid.offsets[r, c])
            heights[a, b], rises[a, b] = height, rise


@compiled
def triangle_weights(row: float, column: float, rows: int, columns: int) -> tuple[int, int, float, float, int]:
    """Return the triangle at a point given as fractional (row, column).

    The result is the row and column of the cell's first sample, the point's position in the cell (v along rows, u along
    columns), and 0 below or 1 above the cell's diagonal. Every cell is cut from (row, column) to (row + 1, column + 1),
    as in the report's Figures 3 and 4. Points outside the map use the nearest cell.
    """
    r = min(max(math.floor(row), 0), rows - 2)
    c = min(max(math.floor(column), 0), columns - 2)
    v, u = row - r, column - c
    return r, c, v, u, 0 if u >= v else 1


@compiled
def surface_at_sample(grid: MovingGrid, row: float, column: float, time: float) -> tuple[float, float]:
    """Return the height [m] and vertical velocity [m/s] of the ground at a fractional sample; NaN over holes."""
    rows, columns = grid.heights.shape
    r, c, v, u, upper = triangle_weights(row, column, rows, columns)
    corner_r, corner_c = (r + 1, c) if upper == 1 else (r, c + 1)
    height, velocity = 0.0, 0.0
    for weight, a, b in (
        (1.0 - max(u, v), r, c), (abs(u - v), corner_r, corner_c), (min(u, v), r + 1, c + 1)
    ):  # fmt: skip
        if weight != 0.0:
            z, rise = sample_at(grid, a, b, time, INSTANT)
            height += weight * z
            velocity += weight * rise / INSTANT
    return height, velocity


@compiled
def ground_at(grid: MovingGrid, xy: FloatArray, time: float, heights: FloatArray, velocities: FloatArray) -> None:
    """Write ``heights`` (N,) [m] and vertical ``velocities`` (N,) [m/s] of the ground under points ``xy`` (N, 2) [m].

    Heights are NaN over holes. Points outside the map are clamped to its edge.
    """
    rows, columns = grid.heights.shape
    for i in range(len(xy)):
        if not (math.isfinite(xy[i, 0]) and math.isfinite(xy[i, 1])):
            heights[i], velocities[i] = math.nan, 0.0
            continue
        row, column = to_grid(grid, xy[i, 0], xy[i, 1])
        row, column = min(max(row, 0.0), rows - 1.0), min(max(column, 0.0), columns - 1.0)
        heights[i], velocities[i] = surface_at_sample(grid, row, column, time)


@compiled
def fill_ground(
    grid: MovingGrid, xy: FloatArray, time: float, edge: float, heights: FloatArray, velocities: FloatArray
) -> None:
    """Write ``heights`` (N,) [m] and vertical ``velocities`` (N,) [m/s] of the ground as `ground_at`, where the height
    is still NaN and the point is on the map. Points up to ``edge`` samples beyond the map count as on it."""
    rows, columns = grid.heights.shape
    for i in range(len(xy)):
        if not math.isnan(heights[i]):
            continue
        row, column = to_grid(grid, xy[i, 0], xy[i, 1])
        if -edge <= row <= rows - 1.0 + edge and -edge <= column <= columns - 1.0 + edge:
            row, column = min(max(row, 0.0), rows - 1.0), min(max(column, 0.0), columns - 1.0)
            heights[i], velocities[i] = surface_at_sample(grid, row, column, time)


@compiled
def samples_at(grid: MovingGrid, indices, time: float, ahead: float, heights: FloatArray, velocities: FloatArray):
    """Write ``heights`` [m] and mean ``velocities`` [m/s] over the time ``ahead`` [s] of samples, all (n,).

    ``indices``: into the row-major map.
    """
    columns = grid.heights.shape[1]
    for i in range(len(indices)):
        heights[i], rise = sample_at(grid, indices[i] // columns, indices[i] % columns, time, ahead)
        velocities[i] = rise / ahead
