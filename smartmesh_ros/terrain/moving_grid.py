"""Evaluation of a moving height map at an instant, for compiled functions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled, inlined
from smartmesh_ros.terrain.correction import BLOCK_SHIFT, remaining
from smartmesh_ros.terrain.motion import INSTANT, KEPT, Mode, block_phase, displacement, motion_of, rise_of
from smartmesh_ros.terrain.noisy_motion import motion_in_noise, noise_variances


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
