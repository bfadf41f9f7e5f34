"""Maps that replace another one: velocities and material with respect to the map before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import overlap
from smartmesh_ros.terrain.grid_track import cells_moved, follow
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.material import Material, new_ground


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
    motion = after.motion
    level = replace(after.geometry, origin=(*after.geometry.origin[:2], before.geometry.origin[2]))
    if motion.corrects:
        return cells_moved(before.geometry, level)
    return follow(before.track, level, after.time, motion.max_interval, motion.max_velocity)[1]


def carry_material(before: HeightMap, after: HeightMap) -> None:
    """Give a map those layers of the material of the map before it, which it replaces, that it was not given.

    One number for the whole map is that of the new map, too. Numbers of samples stay with the ground: at their places
    if the map was scrolled by whole cells, and on the samples of a map that slides. New ground has the usual numbers,
    and so has a map on another grid.
    """
    own, carried = after.material.layers, {}
    for name, layer in before.material.layers.items():
        if name not in own:
            carried[name] = layer if isinstance(layer, float) else _carried(name, layer, before, after)
    if carried:
        after.give(Material(**carried))


def _carried(name: str, layer: NDArray[Any], before: HeightMap, after: HeightMap) -> NDArray[Any] | None:
    """Return a ``layer`` (rows, columns) of the map ``before`` on the samples of the map ``after``; None if the maps
    share no samples."""
    moved = cells_shared(before, after)
    if moved is None:
        return None
    new, old = overlap(moved, layer.shape)
    found = new_ground(name, layer.shape)
    found[new] = layer[old]
    return found
