"""Patches of height maps."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, grid_twist
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.collect import BFS
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.extent import extent_for
from smartmesh_ros.patches.template import PatchTemplate, patch_template
from smartmesh_ros.search.best_first import best_first_cells
from smartmesh_ros.search.brute_force import brute_force_cells
from smartmesh_ros.search.grid import Cells, nearest_vertices
from smartmesh_ros.search.ray_cast import ray_cast
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.graph import GridGraph
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap, Samples
from smartmesh_ros.terrain.terrain import Terrain

_FILLS = {"_rings": 0, "_stride": 0, "_least": 0.0, "_most": -1.0, "_row": -1, "_column": -1}


class GridPatches:
    """Searches and collects the patches of bodies on height maps, a batch per size."""

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch) -> None:
        self.config = config
        self._terrain = terrain
        self._stopwatch = stopwatch
        self._rings = np.empty(0, np.int64)
        self._stride = np.empty(0, np.int64)
        # A patch stays as it is while the reach its body needs lies between these [m].
        self._least = np.empty(0)
        self._most = np.empty(0)
        # Nearest vertex at the update before, -1 = none.
        self._row = np.empty(0, np.int64)
        self._column = np.empty(0, np.int64)

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def forget(self, bodies: IntArray | slice) -> None:
        """Forgets where bodies were: they are on another map now, or patches are to be made anew."""
        self._most[bodies] = -1.0
        self._row[bodies] = self._column[bodies] = -1

    def patches(
        self,
        name: str,
        bodies: IntArray,
        grid: FloatArray,
        positions_w: FloatArray,
        reach: FloatArray,
        time: float,
        before: list[PatchBatch],
    ) -> list[PatchBatch]:
        """Patches on the tile ``name`` at ``time`` [s].

        ``bodies``: indices (n,); ``grid``: their fractional (row, column) (n, 2); ``positions_w`` (n, 3) [m]; ``reach``
        (n,) [m]; ``before``: the batches of the update before.
        """
        heightmap = self._terrain.tiles[name]
        assert isinstance(heightmap, HeightMap)
        self._set_extent(heightmap, bodies, reach)
        with self._stopwatch.stage("search"):
            cells = self._search(heightmap, bodies, grid, positions_w, before)
            if len(self._terrain.tiles) > 1:
                # Where tiles meet there is no rim: the grid goes on beyond the edge.
                nearest = np.ceil(grid - 0.5).astype(np.int64)
                beyond = (nearest < 1) | (nearest > (heightmap.geometry.rows - 2, heightmap.geometry.columns - 2))
                rows, columns = np.where(beyond.any(axis=1), nearest.T, cells)
                cells = Cells(rows, columns)
        self._row[bodies], self._column[bodies] = cells.rows, cells.columns
        rings = self._rings[bodies]
        first = int(rings[0])
        if (rings == first).all():
            return [self._batch(name, heightmap, first, bodies, cells, time)]
        batches: list[PatchBatch] = []
        for size in np.unique(rings):
            of_size = rings == size
            part = Cells(cells.rows[of_size], cells.columns[of_size])
            batches.append(self._batch(name, heightmap, int(size), bodies[of_size], part, time))
        return batches

    def _set_extent(self, heightmap: HeightMap, bodies: IntArray, need: FloatArray) -> None:
        """Grows patches at once and shrinks them only well below the size they have, so that none flickers."""
        outgrown = (need > self._most[bodies]) | (need < self._least[bodies])
        if not outgrown.any():
            return
        bodies = bodies[outgrown]
        geometry = heightmap.geometry
        side = min(geometry.rows, geometry.columns)
        extent = extent_for(need[outgrown], geometry.resolution, side, self.config.rings)
        self._rings[bodies], self._stride[bodies] = extent.rings, extent.stride
        self._least[bodies], self._most[bodies] = extent.least, extent.most

    def _search(
        self,
        heightmap: HeightMap,
        bodies: IntArray,
        grid: FloatArray,
        positions_w: FloatArray,
        before: list[PatchBatch],
    ) -> Cells:
        """Nearest vertices by the chosen method, the map's rim left out."""
        geometry, method = heightmap.geometry, self.config.search
        if method == "grid_traversal":
            return nearest_vertices(geometry, grid)
        if method == "brute_force":
            return brute_force_cells(geometry, grid)
        row, column = self._row[bodies], self._column[bodies]
        if method == "ray_cast":
            hits = _hits(bodies, positions_w, before)
            missed = hits.rows < 0
            if missed.any():
                hits.rows[missed], hits.columns[missed] = brute_force_cells(geometry, grid[missed])
            # A strided patch hits a vertex near the nearest one only; a step or two leads there.
            return best_first_cells(geometry, grid, _inside_rim(geometry.rows, geometry.columns, hits))
        unknown = row < 0
        start = Cells(np.where(unknown, geometry.rows // 2, row), np.where(unknown, geometry.columns // 2, column))
        return best_first_cells(geometry, grid, _inside_rim(geometry.rows, geometry.columns, start))

    def _batch(
        self, name: str, heightmap: HeightMap, rings: int, bodies: IntArray, cells: Cells, time: float
    ) -> PatchBatch:
        geometry = heightmap.geometry
        template = patch_template(rings)
        stride = self._stride[bodies]
        rows, columns, holes = cells.rows, cells.columns, heightmap.has_holes
        with self._stopwatch.stage("collect"):
            margin = rings * stride
            if len(self._terrain.tiles) == 1:
                # Leaving out a rim as wide as the patch keeps its topology constant.
                rows = np.maximum(np.minimum(rows, geometry.rows - 1 - margin), margin)
                columns = np.maximum(np.minimum(columns, geometry.columns - 1 - margin), margin)
                samples = heightmap.sample(*self._indices(heightmap, template, rows, columns, stride), time)
            else:
                samples, holes = self._across_tiles(name, template, rows, columns, stride, time)
        spacing: FloatArray = np.multiply(stride, geometry.resolution, dtype=np.float64)
        centres_w = np.empty((len(bodies), 3))
        centres_w[:, :2] = geometry.to_world(rows, columns)
        centres_w[:, 2] = samples.heights[:, template.centre]
        twist = np.zeros((2, len(bodies), 3))
        if samples.velocities is not None:
            grid_twist(samples.velocities @ template.fit, spacing, geometry.yaw, twist)
        return GridBatch(
            tile=name,
            kind=self.config.grid_kind,
            bodies=bodies,
            triangles=template.triangles,
            rows=rows,
            columns=columns,
            stride=stride,
            centres_w=centres_w,
            linear_w=twist[0],
            angular_w=twist[1],
            heightmap=heightmap,
            template=template,
            spacing=spacing,
            heights_w=samples.heights,
            holes=holes,
        )

    def _indices(
        self, heightmap: HeightMap, template: PatchTemplate, rows: IntArray, columns: IntArray, stride: IntArray
    ) -> tuple[IntArray, IntArray]:
        """Samples of patches (n, K) and their centres (n,), as indices into the map."""
        geometry = heightmap.geometry
        centres = rows * geometry.columns + columns
        if self.config.collect == "cached":
            indices = template.indices(geometry.columns) * stride[:, None]
            indices += centres[:, None]
            return indices, centres
        collect = BFS[self.config.collect]
        collected = [
            collect(GridGraph(geometry.rows, geometry.columns, step), centre, template.rings)
            for centre, step in zip(centres.tolist(), stride.tolist(), strict=True)
        ]
        return np.array(collected, np.int64).reshape(len(centres), template.rows.size), centres

    def _across_tiles(
        self, name: str, template: PatchTemplate, rows: IntArray, columns: IntArray, stride: IntArray, time: float
    ) -> tuple[Samples, bool]:
        """Samples of patches that may reach over the edge of their tile: there the ground is that of the neighbours."""
        heightmap = self._terrain.tiles[name]
        assert isinstance(heightmap, HeightMap)
        geometry = heightmap.geometry
        r = rows[:, None] + template.rows * stride[:, None]
        c = columns[:, None] + template.columns * stride[:, None]
        inner_r, inner_c = np.clip(r, 0, geometry.rows - 1), np.clip(c, 0, geometry.columns - 1)
        middle = template.centre
        heights, velocities = heightmap.sample(
            inner_r * geometry.columns + inner_c, inner_r[:, middle] * geometry.columns + inner_c[:, middle], time
        )
        outside = (inner_r != r) | (inner_c != c)
        holes = heightmap.has_holes
        if outside.any():
            beyond = self._terrain.around(geometry.to_world(r[outside], c[outside]), time)
            heights[outside] = beyond.heights
            if beyond.velocities is not None or velocities is not None:
                velocities = np.zeros_like(heights) if velocities is None else velocities
                velocities[outside] = 0.0 if beyond.velocities is None else beyond.velocities
            holes = True
        return Samples(heights, velocities), holes


def _inside_rim(rows: int, columns: int, cells: Cells) -> Cells:
    return Cells(np.clip(cells.rows, 1, rows - 2), np.clip(cells.columns, 1, columns - 2))


def _hits(bodies: IntArray, positions_w: FloatArray, before: list[PatchBatch]) -> Cells:
    """Vertices that rays from the bodies hit on the patches they had, -1 = missed or none."""
    place = {body: index for index, body in enumerate(bodies.tolist())}
    rows, columns = np.full(len(bodies), -1), np.full(len(bodies), -1)
    for batch in before:
        if not isinstance(batch, GridBatch):
            continue
        members = [i for i, body in enumerate(batch.bodies.tolist()) if body in place]
        if not members:
            continue
        mine = np.array([place[body] for body in batch.bodies[members].tolist()])
        vertex = ray_cast(positions_w[mine], batch.vertices_w()[members], batch.triangles)
        hit = vertex >= 0
        template, stride = batch.template, batch.stride[members]
        rows[mine[hit]] = (batch.rows[members] + template.rows[vertex] * stride)[hit]
        columns[mine[hit]] = (batch.columns[members] + template.columns[vertex] * stride)[hit]
    return Cells(rows, columns)
