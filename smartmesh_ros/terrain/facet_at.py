"""The facet of a moving height map at a point, for compiled functions."""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.correction import BLOCK, BLOCK_SHIFT, remaining
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import KEPT, Mode, block_phase, displacement, motion_of, rise_of
from smartmesh_ros.terrain.moving_grid import INSTANT, MovingGrid, sample_at

# Distance from an edge of a facet at which a point counts as on that edge [cells].
ON_EDGE = 1e-9


class GridFacet(NamedTuple):
    """The plane of the facet at a point, and the plane of its vertical velocity.

    ``z`` [m] and ``rise`` [m/s] at the point, NaN over a hole. ``per_column``, ``per_row`` [m]: change of the height
    from sample to sample.
    """

    z: float
    rise: float
    per_column: float
    per_row: float


NO_FACET = GridFacet(math.nan, 0.0, 0.0, 0.0)


@compiled
def facet_plane(near, corner, far, near_rise, corner_rise, far_rise, v, u, upper):
    """Return the `GridFacet` at the point (v, u) of a cell, below the diagonal or (``upper`` = 1) above it.

    ``near``, ``far``: heights [m] at the two ends of the diagonal; ``corner``: at the third corner; and their vertical
    velocities [m/s].
    """
    if math.isnan(near + corner + far):
        return NO_FACET
    if upper == 1:
        per_row, per_column = corner - near, far - corner
        rise = near_rise + v * (corner_rise - near_rise) + u * (far_rise - corner_rise)
    else:
        per_column, per_row = corner - near, far - corner
        rise = near_rise + u * (corner_rise - near_rise) + v * (far_rise - corner_rise)
    return GridFacet(near + v * per_row + u * per_column, rise, per_column, per_row)


@compiled
def read_cell(grid: MovingGrid, r: int, c: int, time: float, corners: FloatArray) -> None:
    """Write the heights [m] and vertical velocities [m/s] of the samples (r, c), (r, c + 1), (r + 1, c) and
    (r + 1, c + 1) at ``time`` [s] to ``corners`` (2, 4)."""
    rows, columns = grid.heights.shape
    whole = r >= 0 and c >= 0 and r < rows - 1 and c < columns - 1
    one_block = r & (BLOCK - 1) != BLOCK - 1 and c & (BLOCK - 1) != BLOCK - 1
    if not (whole and one_block and grid.noise == 0.0):
        for k in range(4):
            corners[0, k], rise = sample_at(grid, r + k // 2, c + k % 2, time, INSTANT)
            corners[1, k] = rise / INSTANT
        return
    clock, heights, velocities = grid.clocks[r >> BLOCK_SHIFT, c >> BLOCK_SHIFT], grid.heights, grid.velocities
    left = remaining(clock, grid.shown, grid.settle) if grid.mode == Mode.CORRECT else 0.0
    phase = block_phase(clock, time, grid.mode)
    newest, second, third = clock.newest, (clock.newest + KEPT - 1) % KEPT, (clock.newest + KEPT - 2) % KEPT
    for k in range(4):
        a, b = r + k // 2, c + k % 2
        corners[0, k], corners[1, k] = grid.z + float(heights[a, b]), 0.0
        if left > 0.0:
            corners[0, k] += left * float(grid.offsets[a, b])
        elif clock.known and grid.mode != Mode.CORRECT:
            velocity, acceleration = motion_of(
                float(velocities[newest, a, b]), float(velocities[second, a, b]), float(velocities[third, a, b]), phase,
                grid.max_velocity,
            )  # fmt: skip
            corners[0, k] += displacement(velocity, acceleration, phase)
            corners[1, k] = rise_of(velocity, acceleration, phase, INSTANT) / INSTANT


@compiled
def facet_of_cell(corners, v, u, upper):
    """Return the facet at the point (v, u) of a cell with ``corners`` (2, 4), see `read_cell`."""
    third = 2 if upper == 1 else 1
    return facet_plane(
        corners[0, 0], corners[0, third], corners[0, 3], corners[1, 0], corners[1, third], corners[1, 3], v, u, upper
    )


@compiled
def facet_at_sample(grid, row, column, time, corners):
    """Return the facet at a fractional sample inside the map. A point on an edge belongs to each facet there, so it has
    ground if one of these facets is whole. ``corners`` (2, 4): scratch memory."""
    rows, columns = grid.heights.shape
    r, c = min(math.floor(row), rows - 2), min(math.floor(column), columns - 2)
    v, u = row - r, column - c
    read_cell(grid, r, c, time, corners)
    found = facet_of_cell(corners, v, u, 0 if u >= v else 1)
    if not math.isnan(found.z):
        return found
    for a in range(r - 1 if v <= ON_EDGE else r, r + 2 if v >= 1.0 - ON_EDGE else r + 1):
        for b in range(c - 1 if u <= ON_EDGE else c, c + 2 if u >= 1.0 - ON_EDGE else c + 1):
            read_cell(grid, a, b, time, corners)
            for upper in range(2):
                beyond = (row - a) - (column - b)  # above zero beyond the diagonal, for the facet below it
                if (beyond if upper == 0 else -beyond) <= ON_EDGE:
                    found = facet_of_cell(corners, row - a, column - b, upper)
                    if not math.isnan(found.z):
                        return found
    return NO_FACET
