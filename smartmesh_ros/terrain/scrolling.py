"""Maps that replace another one: velocities, friction and soil with respect to the map before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


def carry_layers(before: HeightMap, after: HeightMap) -> None:
    """Give a map whose friction or soil was not given those of the map before it, which it replaces.

    One coefficient for the whole map is that of the new map, too. Coefficients and soils of samples stay with the
    ground: at their places if the map was scrolled by whole cells, and on the samples of a map that slides. New ground
    has the coefficient 1 and the first soil, and so has a map on another grid.
    """
    if before.has_friction and not after.has_friction:
        friction = before.friction if isinstance(before.friction, float) else _carried(before.friction, before, after)
        if friction is not None:
            after.friction = friction
    if before.soil is not None and after.soil is None:
        soil = _carried(before.soil, before, after)
        if soil is not None:
            after.soil = soil


def _carried(layer: NDArray[Any], before: HeightMap, after: HeightMap) -> NDArray[Any] | None:
    """Return a ``layer`` (rows, columns) of the map ``before`` on the samples of the map ``after``: NaN, or zero, on
    new ground. None if the maps share no samples."""
    moved = cells_shared(before, after)
    if moved is None:
        return None
    new, old = overlap(moved, layer.shape)
    found = np.full(layer.shape, np.nan if layer.dtype.kind == "f" else 0, layer.dtype)
    found[new] = layer[old]
    return found


def _levelled(before: GridGeometry, after: GridGeometry) -> GridGeometry:
    """Return the grid ``after`` at the height of the grid ``before`` it."""
    return replace(after, origin=(*after.origin[:2], before.origin[2]))
