"""Maps whose origin moves: what of the map before holds for the one that takes its place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import GridGeometry, overlap
from smartmesh_ros.terrain.grid_track import cells_moved, follow
from smartmesh_ros.terrain.heightmap import HeightMap


def velocities_across(
    before: HeightMap, after: GridGeometry, heights: NDArray[np.float32], time: float
) -> NDArray[np.float32] | None:
    """How fast the samples (rows, columns) that a moved map shares with the one before it rise [m/s], NaN = not shared.
    Samples of a map that slides slide with it.

    None where the maps share nothing, lie too far apart in time to tell, or no sample rises.
    """
    motion, interval = before.motion, time - before.track.time
    _, moved = follow(before.track, after, time, motion.max_interval, motion.max_velocity)
    if moved is None or not 0.0 < interval <= motion.max_interval:
        return None
    (new_rows, old_rows), (new_columns, old_columns) = (
        overlap(cells, size) for cells, size in zip(moved, heights.shape, strict=True)
    )
    velocities = np.full(heights.shape, np.nan, np.float32)
    rise = heights[new_rows, new_columns] - before.heights[old_rows, old_columns]
    rise += np.float32(after.origin[2] - before.geometry.origin[2])
    if moved == (0, 0) and not rise.any():
        return None
    velocities[new_rows, new_columns] = rise / np.float32(interval)
    return velocities


def correct_across(before: HeightMap, after: HeightMap) -> None:
    """Has a map that came elsewhere, or on another grid, correct the one before it where both have ground."""
    after.correct_from(before, cells_moved(before.geometry, after.geometry))
