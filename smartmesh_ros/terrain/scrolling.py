"""Maps that replace another one: velocities, corrections and friction with respect to the map before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import GridGeometry, overlap
from smartmesh_ros.terrain.grid_track import cells_moved, follow
from smartmesh_ros.terrain.heightmap import HeightMap


def velocities_across(
    before: HeightMap, after: GridGeometry, heights: NDArray[np.float32], time: float
) -> NDArray[np.float32] | None:
    """Return vertical velocities (rows, columns) [m/s] of a moved map's samples; NaN = not on the map before.

    Samples of a sliding map move with it. Returns None if the maps share no samples, lie too far apart in time, or no
    sample rises.
    """
    motion, interval = before.motion, time - before.track.time
    _, moved = follow(before.track, after, time, motion.max_interval, motion.max_velocity)
    if moved is None or not 0.0 < interval <= motion.max_interval:
        return None
    new, old = overlap(moved, heights.shape)
    velocities = np.full(heights.shape, np.nan, np.float32)
    rise = heights[new] - before.heights[old]
    rise += np.float32(after.origin[2] - before.geometry.origin[2])
    if moved == (0, 0) and not rise.any():
        return None
    velocities[new] = rise / np.float32(interval)
    return velocities


def follow_across(before: HeightMap, after: HeightMap) -> None:
    """Estimate the motion of a map from the map before it, which it replaces, unless its velocities were given."""
    if not after.has_velocities:
        if _levelled(before.geometry, after.geometry) == before.geometry:
            after.go_on_from(before)
        else:
            velocities = velocities_across(before, after.geometry, after.heights, after.time)
            if velocities is not None:
                after.set_velocities(velocities)
    after.follow(before, after.time)


def carry_friction(before: HeightMap, after: HeightMap) -> None:
    """Give a map whose friction was not given that of the map before it, which it replaces.

    One coefficient for the whole map is that of the new map, too. Coefficients of samples stay with the ground: at
    their places if the map was scrolled by whole cells, and on the samples of a map that slides. New ground has 1, and
    so has a map on another grid.
    """
    known, motion = before.friction, after.motion
    if after.has_friction or not before.has_friction:
        return
    if isinstance(known, float):
        after.friction = known
        return
    if motion.corrects:
        moved = cells_moved(before.geometry, _levelled(before.geometry, after.geometry))
    else:
        _, moved = follow(before.track, after.geometry, after.time, motion.max_interval, motion.max_velocity)
    if moved is None:
        return
    new, old = overlap(moved, known.shape)
    friction = np.full(known.shape, np.nan, np.float32)
    friction[new] = known[old]
    after.friction = friction


def _levelled(before: GridGeometry, after: GridGeometry) -> GridGeometry:
    """Return the grid ``after`` at the height of the grid ``before`` it."""
    return replace(after, origin=(*after.origin[:2], before.origin[2]))
