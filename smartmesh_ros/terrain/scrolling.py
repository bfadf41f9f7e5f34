"""Maps whose origin moves: by whole cells they travel with a robot, else the ground itself slides."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import GridGeometry, overlap
from smartmesh_ros.terrain.heightmap import HeightMap

# How far from a whole number of cells a move may be, as a share of a cell.
OFF_GRID = 0.01


def cells_moved(before: GridGeometry, after: GridGeometry) -> tuple[int, int] | None:
    """(rows, columns) by which the grid was moved; None if it is another grid, or no sample is on both."""
    if replace(after, origin=before.origin) != before or after.origin[2] != before.origin[2]:
        return None
    row, column = before.to_grid(np.array(after.origin[:2]))
    rows, columns = round(float(row)), round(float(column))
    if max(abs(row - rows), abs(column - columns)) > OFF_GRID:
        return None
    return (rows, columns) if abs(rows) < before.rows and abs(columns) < before.columns else None


def velocities_across(
    before: HeightMap, after: GridGeometry, heights: NDArray[np.float32], time: float
) -> NDArray[np.float32] | None:
    """How fast the samples (rows, columns) that a moved map shares with the one before it rise [m/s], NaN = not shared.

    None where the maps share nothing, or lie too far apart in time to tell.
    """
    moved = cells_moved(before.geometry, after)
    interval = time - before.time
    if moved is None or not 0.0 < interval <= before.motion.max_interval or not math.isfinite(interval):
        return None
    (new_rows, old_rows), (new_columns, old_columns) = (
        overlap(cells, size) for cells, size in zip(moved, heights.shape, strict=True)
    )
    velocities = np.full(heights.shape, np.nan, np.float32)
    rise = heights[new_rows, new_columns] - before.heights[old_rows, old_columns]
    velocities[new_rows, new_columns] = rise / np.float32(interval)
    return velocities


def correct_across(before: HeightMap, after: HeightMap) -> None:
    """Has a map that came elsewhere, or on another grid, correct the one before it where both have ground."""
    after.correct_from(before, cells_moved(before.geometry, after.geometry))


def sliding(before: HeightMap, after: HeightMap) -> tuple[float, float]:
    """Horizontal velocity [m/s] of ground whose map came anew elsewhere; zero where it did not slide.

    A map that travels with a robot is moved by whole cells, so that its samples stay where they were (as grid_map and
    costmaps do); the same grid in another place has slid there.
    """
    interval = after.time - before.time
    still = (0.0, 0.0)
    if replace(after.geometry, origin=before.geometry.origin) != before.geometry:
        return still
    moved = cells_moved(before.geometry, after.geometry)
    goes_on = moved == (0, 0) and before.slide_w != still  # the next map of ground that slides may come very soon
    if (moved is not None and not goes_on) or not 0.0 < interval <= after.motion.max_interval:
        return still
    x, y = (b - a for a, b in zip(before.geometry.origin[:2], after.geometry.origin[:2], strict=True))
    return (x / interval, y / interval) if math.hypot(x, y) <= after.motion.max_velocity * interval else still
