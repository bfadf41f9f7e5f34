"""The true ground of a recording.

If changes of height are motion, the true ground is interpolated between the map before and the map after an instant. If
changes are corrections, the true ground is the node's main mesh, which applies corrections over ``terrain.settle``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.tune.case import Change, Ground, MapCame, RegionCame
from smartmesh_ros.tools.tune.replay import change_terrain

# A time [s], and a tile from then on; None = the tile was removed.
State = tuple[float, Raster | None]


class RecordedGround:
    """The ground of a recording at times that never decrease."""

    def __init__(self, changes: Sequence[Change], settings: Settings) -> None:
        if settings.motion.corrects:
            self._tiles: Sequence[_Moving | _Corrected] = [_Corrected(changes, settings)]
        else:
            tiles = dict.fromkeys(change.tile for change in changes)
            self._tiles = [_Moving(tile, [change for change in changes if change.tile == tile]) for tile in tiles]

    def rasters(self, time: float) -> list[tuple[str, Raster]]:
        """Return name and heights of each tile at a time [s]."""
        return [found for tile in self._tiles for found in tile.at(time)]

    def at(self, time: float) -> list[Ground]:
        """Return the ground at a time [s]."""
        return [
            Ground(Surface(replace(geometry, yaw=0.0), heights.astype(np.float64)), geometry.yaw)
            for _, (geometry, heights, *_) in self.rasters(time)
        ]


class _Moving:
    """One tile, interpolated between the map before and the map after an instant."""

    def __init__(self, tile: str, changes: Sequence[Change]) -> None:
        self._tile = tile
        self._states = _states(sorted(changes, key=lambda change: change.at))
        self._before: State | None = None
        self._after: State | None = next(self._states)

    def at(self, time: float) -> Iterator[tuple[str, Raster]]:
        while self._after is not None and self._after[0] <= time:
            self._before, self._after = self._after, next(self._states, None)
        begin, before = self._before or (0.0, None)
        end, after = self._after or (0.0, None)
        if before is None:
            return
        geometry, heights, *_ = before
        if after is not None and after.geometry == geometry:
            heights = heights + np.float32((time - begin) / (end - begin)) * (after.heights - heights)
        yield self._tile, Raster(geometry, heights)


def _states(changes: Sequence[Change]) -> Iterator[State]:
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

    def at(self, time: float) -> Iterator[tuple[str, Raster]]:
        while self._changes and self._changes[-1].arrives <= time:
            change = self._changes.pop()
            self._show(change.arrives)
            with suppress(InputError):  # what the node refuses leaves its ground as it was
                change_terrain(self._terrain, self._settings, change, change.arrives)
        self._show(time)
        for name, mesh in self._terrain.tiles.items():
            if isinstance(mesh, HeightMap):
                geometry = mesh.geometry
                indices = np.arange(geometry.size).reshape(geometry.rows, geometry.columns)
                heights = mesh.sample(indices, time).heights - geometry.origin[2]
                yield name, Raster(geometry, heights.astype(np.float32))

    def _show(self, time: float) -> None:
        for mesh in self._terrain.tiles.values():
            if isinstance(mesh, HeightMap):
                mesh.show(time)
