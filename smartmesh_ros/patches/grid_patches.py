"""Patches of height maps: one of fixed extent for each body, or as much as it needs."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.auto import AutoPatches
from smartmesh_ros.patches.batch import GridBatch, PatchBatch, SurfaceTwist, plane_twist
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.extent import extent_for
from smartmesh_ros.patches.grid_collect import Collected, collect_across, collect_inside, fit_in
from smartmesh_ros.patches.grid_search import GridSearch
from smartmesh_ros.patches.moving import Moving
from smartmesh_ros.patches.planes import facet_nearest, planes_through
from smartmesh_ros.patches.standing import planes_in_world
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain

_FILLS = {"_rings": 0, "_stride": 0, "_least": 0.0, "_most": -1.0}


class GridPatches:
    """Searches and collects the patches of bodies on height maps, a batch per size."""

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch) -> None:
        self._config = config
        self._terrain = terrain
        self._stopwatch = stopwatch
        self._search = GridSearch()
        self._auto = AutoPatches(config, self._search, stopwatch)
        self._rings = np.empty(0, np.int64)
        self._stride = np.empty(0, np.int64)
        # A patch stays as it is while the reach its body needs lies between these [m].
        self._least = np.empty(0)
        self._most = np.empty(0)

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings; every patch is made anew."""
        self._config = config
        self._auto.configure(config)
        self._most[:] = -1.0
        self._search.forget(slice(None))

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)
        self._search.set_bodies(kept)
        self._auto.set_bodies(kept)

    def forget(self, bodies: IntArray | slice) -> None:
        """Forgets where bodies were: they are on another map now, or patches are to be made anew."""
        self._most[bodies] = -1.0
        self._search.forget(bodies)
        self._auto.forget(bodies)

    def patches(
        self, name: str, moving: Moving, time: float, dt: float, before: list[PatchBatch], *, lively: bool
    ) -> list[PatchBatch]:
        """Patches on the tile ``name`` at ``time`` [s] for a step of ``dt`` [s]; ``before``: the batches of the update
        before; ``lively``: colliders do not last."""
        if not self._config.chooses:
            return self.of_fixed_extent(name, moving, time, before)
        heightmap = self._terrain.tiles[name]
        assert isinstance(heightmap, HeightMap)
        batches, fixed = self._auto.patches(name, heightmap, moving, time, dt, before, lively=lively)
        if fixed.size:
            batches += self.of_fixed_extent(name, moving.of(fixed), time, before)
        return batches

    def of_fixed_extent(
        self, name: str, moving: Moving, time: float, before: list[PatchBatch], *, solid: bool = True
    ) -> list[PatchBatch]:
        """Patches of as many rings as the bodies' size asks for, chosen or not; of bodies that are not ``solid``
        nobody need know the plane under them, nor how it moves."""
        heightmap = self._terrain.tiles[name]
        assert isinstance(heightmap, HeightMap)
        bodies, grid, geometry = moving.bodies, moving.grid, heightmap.geometry
        self._set_extent(heightmap, bodies, moving.reach)
        with self._stopwatch.stage("search"):
            cells = self._search.nearest(self._config.search, geometry, bodies, grid, moving.positions_w, before)
            if len(self._terrain.tiles) > 1:
                # Where tiles meet there is no rim: the grid goes on beyond the edge.
                nearest = np.ceil(grid - 0.5).astype(np.int64)
                beyond = (nearest < 1) | (nearest > (geometry.rows - 2, geometry.columns - 2))
                rows, columns = np.where(beyond.any(axis=1), nearest.T, cells)
                cells = Cells(rows, columns)
        rings = self._rings[bodies]
        first = int(rings[0])
        if (rings == first).all():
            return [self._batch(name, heightmap, first, moving, cells, time, solid=solid)]
        batches: list[PatchBatch] = []
        for size in np.unique(rings):
            of_size = rings == size
            part = Cells(cells.rows[of_size], cells.columns[of_size])
            batches.append(self._batch(name, heightmap, int(size), moving.of(of_size), part, time, solid=solid))
        return batches

    def _set_extent(self, heightmap: HeightMap, bodies: IntArray, need: FloatArray) -> None:
        """Grows patches at once and shrinks them only well below the size they have, so that none flickers."""
        outgrown = (need > self._most[bodies]) | (need < self._least[bodies])
        if not outgrown.any():
            return
        bodies = bodies[outgrown]
        geometry = heightmap.geometry
        side = min(geometry.rows, geometry.columns)
        extent = extent_for(need[outgrown], geometry.resolution, side, self._config.rings)
        self._rings[bodies], self._stride[bodies] = extent.rings, extent.stride
        self._least[bodies], self._most[bodies] = extent.least, extent.most

    def _batch(
        self, name: str, heightmap: HeightMap, rings: int, moving: Moving, cells: Cells, time: float, *, solid: bool
    ) -> GridBatch:
        template, bodies = patch_template(rings), moving.bodies
        stride = self._stride[bodies]
        with self._stopwatch.stage("collect"):
            if len(self._terrain.tiles) == 1:
                nearest, cells = cells, fit_in(heightmap.geometry, cells, rings * stride)
                ground = collect_inside(heightmap, template, cells, stride, time, self._config.collect)
            else:
                nearest, ground = cells, collect_across(self._terrain, heightmap, template, cells, stride, time)
        centres_w = np.empty((len(bodies), 3))
        centres_w[:, :2], centres_w[:, 2] = heightmap.geometry.to_world(*cells), ground.heights[:, template.centre]
        look = partial(ground_under, heightmap, ground, cells, stride, moving, centres_w)
        under = look() if solid else None
        # Patches that were moved off the map's edge have other facets in their middle than those under the bodies.
        known = not ground.holes and all(map(np.array_equal, nearest, cells))
        plane = under if known and self._config.grid_kind == "heightfield" else None
        unknown = np.full(len(bodies), np.nan)
        # All samples that a body can touch leave nothing to deviate; another tile's may be read between its own.
        whole = not (self._config.rings or ground.holes) and len(self._terrain.tiles) == 1
        deviation = np.where(stride == 1, 0.0, np.nan) if whole else unknown
        spacing: FloatArray = np.multiply(stride, heightmap.geometry.resolution, dtype=np.float64)
        return GridBatch(
            tile=name, kind=self._config.grid_kind, bodies=bodies, triangles=template.triangles, rows=cells.rows,
            columns=cells.columns, stride=stride, centres_w=centres_w,
            surface=(lambda: look().twist) if under is None else under.twist, deviation=deviation,
            heightmap=heightmap, template=template, spacing=spacing, time=time, since=unknown, ground=ground,
            points_w=None if plane is None else plane.points_w, normals_w=None if plane is None else plane.normals_w,
        )  # fmt: skip


class Under(NamedTuple):
    """The facet under n bodies: its plane by its point nearest to the body (n, 3) [m] and its upward normal (n, 3), NaN
    over a hole; and how it moves at the patch's centre."""

    points_w: FloatArray
    normals_w: FloatArray
    twist: SurfaceTwist


def ground_under(
    heightmap: HeightMap, ground: Collected, cells: Cells, stride: IntArray, moving: Moving, centres_w: FloatArray
) -> Under:
    """The facet under each body.

    The rigid motion nearest to the whole patch is another one where the velocity is curved: a body would sink into the
    crest of a wave.
    """
    geometry, holes = heightmap.geometry, ground.holes
    spacing = stride * geometry.resolution
    u, v = (moving.grid[:, 1] - cells.columns) / stride, (moving.grid[:, 0] - cells.rows) / stride
    nine = _middle_nine(ground.heights)
    centres = np.empty((len(u), 3))
    centres[:, 0], centres[:, 1], centres[:, 2] = u * spacing, v * spacing, moving.positions_w[:, 2]
    which = facet_nearest(nine, centres, np.zeros((len(stride), 2)), spacing, holes=holes)
    plane = planes_through(nine, which, spacing, holes=holes)
    _, points_w, normals_w = planes_in_world(plane, centres_w[:, :2], moving.positions_w, geometry.yaw)
    if ground.velocities is None:
        return Under(points_w, normals_w, SurfaceTwist(*np.zeros((2, len(stride), 3))))
    rates = planes_through(_middle_nine(ground.velocities), which, spacing, holes=False)
    return Under(points_w, normals_w, plane_twist(heightmap, rates))


def _middle_nine(samples: FloatArray) -> FloatArray:
    """The 3 x 3 samples in the middle of patches (n, K), as (n, 9)."""
    count, side = len(samples), math.isqrt(samples.shape[1])
    if side == 3:
        return samples
    middle = slice(side // 2 - 1, side // 2 + 2)
    return samples.reshape(count, side, side)[:, middle, middle].reshape(count, 9)
