"""The true ground of a recording.

If changes of height are motion, the true ground is interpolated between the map before and the map after an instant. If
changes are corrections, the true ground is the node's main mesh, which applies corrections over ``terrain.settle``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smartmesh_ros.io.rasters import FloatGrid, Raster
from smartmesh_ros.node.inputs.map_taking import take_map
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.tools.tune.case import Ground
from smartmesh_ros.tools.tune.events import MapCame, RegionCame

Change = MapCame | RegionCame


@dataclass(frozen=True)
class _Known:
    """A tile at ``time`` [s]; no raster = the tile was removed."""

    time: float
    raster: Raster | None


class Truth:
    """The ground of a recording at times that never decrease."""

    def __init__(self, changes: Sequence[Change], settings: Settings) -> None:
        self._corrected = _Corrected(changes, settings) if settings.motion.corrects else None
        tiles = dict.fromkeys(change.tile for change in changes)
        self._moving = {tile: _Moving([change for change in changes if change.tile == tile]) for tile in tiles}

    def rasters(self, time: float) -> Iterator[tuple[str, Raster]]:
        """Yield name and heights of each tile at a time [s]."""
        if self._corrected is not None:
            yield from self._corrected.at(time)
            return
        for tile, moving in self._moving.items():
            raster = moving.at(time)
            if raster is not None:
                yield tile, raster

    def at(self, time: float) -> list[Ground]:
        """Return the ground at a time [s]."""
        return [ground_of(raster.geometry, raster.heights) for _, raster in self.rasters(time)]


def ground_of(geometry: GridGeometry, heights: FloatGrid) -> Ground:
    """Return a tile as a surface without yaw, and its yaw."""
    return Ground(Surface(replace(geometry, yaw=0.0), heights.astype(np.float64)), geometry.yaw)


class _Moving:
    """One tile, interpolated between the map before and the map after an instant."""

    def __init__(self, changes: Sequence[Change]) -> None:
        self._changes = sorted(changes, key=lambda change: change.at)
        self._next = 0
        self._before: _Known | None = None
        self._after: _Known | None = self._following(None)

    def at(self, time: float) -> Raster | None:
        while self._after is not None and self._after.time <= time:
            self._before, self._after = self._after, self._following(self._after)
        before, after = self._before, self._after
        if before is None or before.raster is None:
            return None
        if after is None or after.raster is None or after.raster.geometry != before.raster.geometry:
            return before.raster
        share = np.float32((time - before.time) / (after.time - before.time))
        heights = before.raster.heights + share * (after.raster.heights - before.raster.heights)
        return Raster(before.raster.geometry, heights)

    def _following(self, known: _Known | None) -> _Known | None:
        """Return the tile after the next change; None = no further change."""
        if self._next == len(self._changes):
            return None
        change = self._changes[self._next]
        self._next += 1
        if isinstance(change, MapCame):
            return _Known(change.at, change.raster)
        if known is None or known.raster is None:
            return _Known(change.at, None)
        heights = known.raster.heights.copy()
        rows, columns = change.heights.shape
        part = heights[change.row : change.row + rows, change.column : change.column + columns]
        if part.shape == change.heights.shape:  # else the node refuses it
            part[...] = change.heights
        return _Known(change.at, Raster(known.raster.geometry, heights))


class _Corrected:
    """Ground at rest, as the node estimates it."""

    def __init__(self, changes: Sequence[Change], settings: Settings) -> None:
        self._changes = sorted(changes, key=lambda change: change.arrives)
        self._settings = settings
        self._terrain = Terrain()
        self._next = 0

    def at(self, time: float) -> Iterator[tuple[str, Raster]]:
        while self._next < len(self._changes) and self._changes[self._next].arrives <= time:
            change = self._changes[self._next]
            self._next += 1
            self._show(change.arrives)
            if isinstance(change, RegionCame):
                tile = self._terrain.tile(change.tile)
                if isinstance(tile, HeightMap):
                    tile.update_region(change.row, change.column, change.heights, time=change.at)
            elif change.raster is None:
                self._terrain.remove(change.tile)
            else:
                take_map(self._terrain, self._settings, change.tile, change.raster, change.velocities, change.at)
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
