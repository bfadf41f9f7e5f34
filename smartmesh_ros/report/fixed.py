"""Patches of fixed extent on height maps: rings around the nearest vertex, as many as the settings or the body's size
require, found by the report's search and collect methods."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.patches.shapes import ShapeTable
from smartmesh_ros.patches.tables import with_rows
from smartmesh_ros.report.batch import PatchBatch, rectangle_samples, samples_across
from smartmesh_ros.report.collect import BFS, GridGraph
from smartmesh_ros.report.config import MOST_GRID_RINGS, ReportConfig
from smartmesh_ros.report.search import Cells, nearest_cells
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap, Samples
from smartmesh_ros.terrain.terrain import Terrain

UNKNOWN_EXTENT = (0.0, 0.0, 0.0, -1.0)


class Extent(NamedTuple):
    """Size of N patches, arrays of shape (N,): rings around the centre and stride from ring to ring [samples]; and
    ``least`` to ``most`` [m], the range of reaches for which a patch keeps this size."""

    rings: IntArray
    stride: IntArray
    least: FloatArray
    most: FloatArray


def extent_for(
    reach: FloatArray, resolution: float, smallest_side: int, fixed_rings: int = 0, most_rings: int = MOST_GRID_RINGS
) -> Extent:
    """Return the size of patches for bodies that can touch ground within ``reach`` [m] of their centre until the next
    update.

    ``resolution`` [m] and ``smallest_side`` [samples] are the map's. ``fixed_rings`` > 0 sets the rings (the report's
    collider-size) with stride 1. A body that needs more than ``most_rings`` gets a coarser stride. A patch is never
    larger than the map.
    """
    room = (smallest_side - 1) // 2
    if fixed_rings:
        rings = np.full(reach.shape, min(fixed_rings, room))
        return Extent(rings, np.ones_like(rings), np.zeros_like(reach), np.full_like(reach, np.inf))
    # Half a cell more, because the patch is centred on the nearest vertex instead of the body.
    cells = np.clip(np.ceil(reach / resolution + 0.5 - 1e-9).astype(np.int64), 1, room)
    stride = -(-cells // most_rings)
    rings = np.maximum(np.minimum(-(-cells // stride), room // stride), 1)
    covered = rings * stride
    most = np.where(covered + stride > room, np.inf, (covered - 0.5) * resolution)
    return Extent(rings, stride, (covered - stride - 1.0) * resolution, most)


class FixedPatches:
    """Searches and collects patches of fixed extent. Bodies are addressed by slot."""

    def __init__(self, terrain: Terrain, stopwatch: Stopwatch) -> None:
        self._terrain = terrain
        self._stopwatch = stopwatch
        # Rings and stride of each body's patch, and the range of reaches [m] for which the patch keeps this size.
        self._extents = np.zeros((0, 4))

    def grow(self, slots: int) -> None:
        """Make room for ``slots`` slots."""
        self._extents = with_rows(self._extents, slots, UNKNOWN_EXTENT)

    def forget(self, bodies: IntArray | slice) -> None:
        """Discard the patch sizes of ``bodies``, because the bodies changed their map or the settings changed."""
        self._extents[bodies, 3] = -1.0

    def select(
        self, heightmap: HeightMap, chosen: IntArray, shapes: ShapeTable, bodies: FloatArray, reach: FloatArray,
        time: float, duration: float, config: ReportConfig, supports: Any, before: list[PatchBatch],
    ) -> None:  # fmt: skip
        """Write the supports of the bodies in ``chosen`` (n,) on a map.

        ``shapes``: of S slots; ``bodies`` (S, 13); ``supports`` (S,): records of ``SUPPORT``. ``reach`` (n,)
        [m]: radius about each body's centre within which it can touch ground until the next update; ``before``: the
        patches of the last update, for the ray-cast search.
        """
        geometry = heightmap.placed_at(time)
        self._set_extents(heightmap, chosen, reach, config)
        with self._stopwatch.stage("search"):
            grid = geometry.to_grid(bodies[chosen, :2])
            known = supports[chosen]
            cells = nearest_cells(config.search, geometry, chosen, grid, bodies[chosen, :3], before, known)
            if len(self._terrain.tiles) > 1:
                # Several tiles have no rim between them: a neighbour tile continues the grid beyond the edge.
                nearest = np.ceil(grid - 0.5).astype(np.int64)
                beyond = (nearest < 1) | (nearest > (geometry.rows - 2, geometry.columns - 2))
                cells = Cells(*np.where(beyond.any(axis=1), nearest.T, cells))
        with self._stopwatch.stage("collect"):
            rings = self._extents[chosen, 0].astype(np.int64)
            for size in np.unique(rings).tolist():
                of_size = np.flatnonzero(rings == size)
                part = Cells(cells.rows[of_size], cells.columns[of_size])
                self._of_size(heightmap, size, chosen[of_size], part, shapes, bodies, time, duration, config, supports)

    def _set_extents(self, heightmap: HeightMap, chosen: IntArray, need: FloatArray, config: ReportConfig) -> None:
        """Grow patches at once, but shrink them only well below their size, so that no patch alternates between two
        sizes."""
        _, _, least, most = self._extents[chosen].T
        outgrown = (need > most) | (need < least)
        geometry = heightmap.geometry
        side = min(geometry.rows, geometry.columns)
        extent = extent_for(need[outgrown], geometry.resolution, side, config.rings, config.most_rings)
        self._extents[chosen[outgrown]] = np.stack(extent, axis=1)

    def _of_size(
        self, heightmap: HeightMap, rings: int, chosen: IntArray, cells: Cells, shapes: ShapeTable,
        bodies: FloatArray, time: float, duration: float, config: ReportConfig, supports: Any,
    ) -> None:  # fmt: skip
        """Write the supports of the bodies in ``chosen`` (n,), whose patches have as many ``rings``."""
        geometry, stride = heightmap.geometry, self._extents[chosen, 1].astype(np.int64)
        rows, columns = cells
        if len(self._terrain.tiles) == 1:  # stay one patch away from the edge, so that every patch is complete
            margin = rings * stride
            rows = np.maximum(np.minimum(rows, geometry.rows - 1 - margin), margin)
            columns = np.maximum(np.minimum(columns, geometry.columns - 1 - margin), margin)
        size = 2 * rings + 1
        for name, values in (
            ("row", rows - rings * stride), ("column", columns - rings * stride), ("rows", size), ("columns", size),
            ("stride", stride),
        ):  # fmt: skip
            supports[name][chosen] = values
        now, velocities = self._collect(heightmap, rings, supports[chosen], time, duration, config)
        whole = not config.rings and len(self._terrain.tiles) == 1 and not np.isnan(now).any()
        supports["deviation"][chosen] = np.where((stride == 1) & whole, 0.0, np.nan)
        CORE.find_feet(
            heightmap.core_reader, shapes.core, bodies, chosen, now.reshape(-1, size, size),
            velocities.reshape(-1, size, size), time, as_bytes(supports),
        )  # fmt: skip

    def _collect(
        self, heightmap: HeightMap, rings: int, supports: Any, time: float, ahead: float, config: ReportConfig
    ) -> Samples:
        """Return the samples (n, K) of the rectangles of ``supports`` (n,) by the configured method."""
        rows, columns = rectangle_samples(supports)
        if config.collect == "cached" or len(self._terrain.tiles) > 1:
            return samples_across(self._terrain, heightmap, rows, columns, time, ahead)
        collect, geometry, middle = BFS[config.collect], heightmap.geometry, rows.shape[1] // 2
        centres = rows[:, middle] * geometry.columns + columns[:, middle]
        indices = [
            collect(GridGraph(geometry.rows, geometry.columns, step), centre, rings)
            for centre, step in zip(centres.tolist(), supports["stride"].tolist(), strict=True)
        ]
        return heightmap.sample(np.array(indices, np.int64).reshape(rows.shape), time, ahead)
