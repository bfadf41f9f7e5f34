"""Maps that replace another one: velocities, corrections and friction with respect to the map before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from smartmesh_ros.terrain.grid import GridGeometry, overlap
from smartmesh_ros.terrain.grid_track import cells_moved, follow
from smartmesh_ros.terrain.heightmap import HeightMap


def follow_across(before: HeightMap, after: HeightMap) -> None:
    """Estimate the motion of a map from the map before it, which it replaces, unless its velocities were given."""
    if not after.has_velocities:
        cells = cells_shared(before, after)
        if cells is not None:
            after.go_on_from(before, cells)
    after.follow(before, after.time)


def cells_shared(before: HeightMap, after: HeightMap) -> tuple[int, int] | None:
    """Return the (rows, columns) by which a map was scrolled since the map before it; None if they share no samples.
    Samples of a sliding map move with it."""
    motion, level = after.motion, _levelled(before.geometry, after.geometry)
    if motion.corrects:
        return cells_moved(before.geometry, level)
    return follow(before.track, level, after.time, motion.max_interval, motion.max_velocity)[1]


def carry_friction(before: HeightMap, after: HeightMap) -> None:
    """Give a map whose friction was not given that of the map before it, which it replaces.

    One coefficient for the whole map is that of the new map, too. Coefficients of samples stay with the ground: at
    their places if the map was scrolled by whole cells, and on the samples of a map that slides. New ground has 1, and
    so has a map on another grid.
    """
    known = before.friction
    if after.has_friction or not before.has_friction:
        return
    if isinstance(known, float):
        after.friction = known
        return
    moved = cells_shared(before, after)
    if moved is None:
        return
    new, old = overlap(moved, known.shape)
    friction = np.full(known.shape, np.nan, np.float32)
    friction[new] = known[old]
    after.friction = friction


def _levelled(before: GridGeometry, after: GridGeometry) -> GridGeometry:
    """Return the grid ``after`` at the height of the grid ``before`` it."""
    return replace(after, origin=(*after.origin[:2], before.origin[2]))
