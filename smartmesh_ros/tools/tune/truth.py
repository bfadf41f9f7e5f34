"""The true ground of a recording.

If changes of height are motion, the true ground is interpolated between the map before and the map after an instant. If
changes are corrections, the true ground is the node's main mesh, which applies corrections over ``terrain.settle``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.tune.replay import Change, MapCame, RegionCame, change_terrain

# The tiles by name at a time [s]; from call to call the time never decreases.
Tiles = Callable[[float], dict[str, Raster]]


def recorded_ground(changes: Sequence[Change], settings: Settings) -> Tiles:
    """Return the true ground of a recording's changes."""
    if settings.motion.corrects:
        return _Corrected(changes, settings).at
    of_tiles: dict[str, list[Change]] = defaultdict(list)
    for change in sorted(changes, key=lambda change: change.at):
        of_tiles[change.tile].append(change)
    tiles = [_Moving(name, of_tile) for name, of_tile in of_tiles.items()]
    return lambda time: dict(found for tile in tiles for found in tile.at(time))


class _Moving:
    """One tile, interpolated between the map before and the map after an instant."""

    def __init__(self, name: str, changes: Sequence[Change]) -> None:
        self._name = name
        self._states = _states(changes)
        # A time [s], and the tile from then on; None = it is removed.
        self._before: tuple[float, Raster | None] = 0.0, None
        self._after: tuple[float, Raster | None] | None = next(self._states)

    def at(self, time: float) -> Iterator[tuple[str, Raster]]:
        while self._after is not None and self._after[0] <= time:
            self._before, self._after = self._after, next(self._states, None)
        (begin, before), (end, after) = self._before, self._after or (0.0, None)
        if before is None:
            return
        geometry, heights, *_ = before
        if after is not None and after.geometry == geometry:
            heights = heights + np.float32((time - begin) / (end - begin)) * (after.heights - heights)
        yield self._name, Raster(geometry, heights)


def _states(changes: Sequence[Change]) -> Iterator[tuple[float, Raster | None]]:
    """Yield a tile after each of its changes."""
    raster: Raster | None = None
    for change in changes:
        if isinstance(change, MapCame):
            raster = change.raster
        elif isinstance(change, RegionCame) and raster is not None:
            heights = raster.heights.copy()
            rows, columns = change.heights.shape
            part = heights[change.row : change.row + rows, change.column : change.column + columns]
            if part.shape == change.heights.shape:  # else the node refuses it
                part[...] = change.heights
            raster = raster._replace(heights=heights)
        yield change.at, raster


class _Corrected:
    """Ground at rest, as the node estimates it."""

    def __init__(self, changes: Sequence[Change], settings: Settings) -> None:
        self._changes = sorted(changes, key=lambda change: change.arrives, reverse=True)
        self._settings = settings
        self._terrain = Terrain()

    def at(self, time: float) -> dict[str, Raster]:
        while self._changes and self._changes[-1].arrives <= time:
            change = self._changes.pop()
            self._show(change.arrives)
            with suppress(InputError):  # what the node refuses leaves its ground as it was
                change_terrain(self._terrain, self._settings, change)
        return {name: self._raster(tile, time) for name, tile in self._show(time).items()}

    def _show(self, time: float) -> dict[str, Any]:
        """Blend corrections in up to ``time`` [s]; return the tiles, which are height maps."""
        tiles: dict[str, Any] = self._terrain.tiles
        for tile in tiles.values():
            tile.show(time)
        return tiles

    def _raster(self, tile: Any, time: float) -> Raster:
        geometry = tile.geometry
        indices = np.arange(geometry.size).reshape(geometry.rows, geometry.columns)
        return Raster(geometry, (tile.sample(indices, time).heights - geometry.origin[2]).astype(np.float32))
