"""One patch under each body, kept up with the bodies and the ground."""

import math
from dataclasses import dataclass

import numpy as np

from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.extent import extent_for
from smartmesh_ros.patches.template import PatchTemplate, patch_template
from smartmesh_ros.search.grid import nearest_vertices
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchBatch:
    """Patches of n bodies that share a tile and a template of K samples.

    ``bodies``: indices of the bodies (n,). ``rows``, ``columns``: nearest vertex (n,). ``stride``: samples of the map
    from one sample of the patch to the next (n,), ``spacing`` the same in [m]. ``centres_w``: position of the nearest
    vertex (n, 3) [m]. ``heights_w``: z of the samples (n, K) [m], NaN = no ground. ``linear_w``, ``angular_w``:
    velocity of the ground at the centre and its turning, (n, 3) [m/s, rad/s].
    """

    tile: str
    heightmap: HeightMap
    template: PatchTemplate
    bodies: IntArray
    rows: IntArray
    columns: IntArray
    stride: IntArray
    spacing: FloatArray
    centres_w: FloatArray
    heights_w: FloatArray
    linear_w: FloatArray
    angular_w: FloatArray

    def vertices_w(self) -> FloatArray:
        """Vertices of all patches (n, K, 3) [m], in the order of the template."""
        template = self.template
        rows = self.rows[:, None] + template.rows * self.stride[:, None]
        columns = self.columns[:, None] + template.columns * self.stride[:, None]
        vertices = np.empty((*rows.shape, 3))
        vertices[..., :2] = self.heightmap.geometry.to_world(rows, columns)
        vertices[..., 2] = self.heights_w
        return vertices


class PatchTracker:
    """Searches and collects the patches of all bodies, a batch per tile and size."""

    def __init__(self, terrain: Terrain, config: PatchConfig, stopwatch: Stopwatch | None = None) -> None:
        self.terrain = terrain
        self.config = config
        self.stopwatch = stopwatch or Stopwatch()
        self._radii = np.empty(0)
        self._rings = np.empty(0, np.int64)
        self._stride = np.empty(0, np.int64)

    def set_bodies(self, radii: FloatArray, kept: IntArray) -> None:
        """Says which bodies there are: bounding ``radii`` (N,) [m] and, per body, its index before or -1 (N,)."""
        known = kept >= 0
        for name in ("_rings", "_stride"):
            old = getattr(self, name)
            new = np.zeros(len(radii), np.int64)
            new[known] = old[kept[known]]
            setattr(self, name, new)
        self._radii = np.asarray(radii, np.float64)

    def update(self, positions_w: FloatArray, travel: FloatArray, time: float) -> list[PatchBatch]:
        """Patches at ``time`` [s] for bodies at ``positions_w`` (N, 3) [m] that may ``travel`` (N,) [m] until the next
        update. Bodies off the terrain, or whose position is not finite, get none."""
        batches = []
        for name, heightmap, bodies in self._tiles_of(positions_w):
            self._set_extent(heightmap, bodies, travel)
            for rings in np.unique(self._rings[bodies]):
                members = bodies[self._rings[bodies] == rings]
                batches.append(self._batch(name, heightmap, int(rings), members, positions_w[members], time))
        return batches

    def _tiles_of(self, positions_w: FloatArray) -> list[tuple[str, HeightMap, IntArray]]:
        """Bodies by the tile they stand on, or overlap from outside."""
        waiting = np.asarray(np.isfinite(positions_w).all(axis=1))
        found = []
        for name, heightmap in self.terrain.tiles.items():
            geometry = heightmap.geometry
            grid = geometry.to_grid(positions_w[:, :2])
            last = (geometry.rows - 1, geometry.columns - 1)
            beyond = np.maximum(np.maximum(-grid, grid - last), 0.0).max(axis=1) * geometry.resolution
            bodies = np.flatnonzero(waiting & (beyond <= self._radii))
            if bodies.size:
                waiting[bodies] = False
                found.append((name, heightmap, bodies))
        return found

    def _set_extent(self, heightmap: HeightMap, bodies: IntArray, travel: FloatArray) -> None:
        """Grows patches at once and shrinks them only well below the size they have, so that none flickers."""
        geometry = heightmap.geometry
        side = min(geometry.rows, geometry.columns)
        radii = self._radii[bodies]
        need, slack = (
            extent_for(radii, way, geometry.resolution, side, self.config.rings)
            for way in (travel[bodies], travel[bodies] + 0.5 * geometry.resolution)
        )
        old_rings, old_stride = self._rings[bodies], self._stride[bodies]
        keep = (old_rings == slack.rings) & (old_stride == slack.stride)
        self._rings[bodies] = np.where(keep, old_rings, need.rings)
        self._stride[bodies] = np.where(keep, old_stride, need.stride)

    def _batch(
        self, name: str, heightmap: HeightMap, rings: int, bodies: IntArray, positions_w: FloatArray, time: float
    ) -> PatchBatch:
        geometry = heightmap.geometry
        template = patch_template(rings)
        stride = self._stride[bodies]
        with self.stopwatch.stage("search"):
            rows, columns = nearest_vertices(geometry, positions_w, rings * stride)
        with self.stopwatch.stage("collect"):
            centres = geometry.flat_index(rows, columns)
            offsets = template.rows * geometry.columns + template.columns
            indices = centres[:, None] + offsets * stride[:, None]
            heights, velocities = heightmap.sample(indices, centres, time)
        spacing = stride.astype(np.float64) * geometry.resolution
        centres_w = np.empty((len(bodies), 3))
        centres_w[:, :2] = geometry.to_world(rows, columns)
        centres_w[:, 2] = heights[:, template.centre]
        linear, angular = _surface_twist(velocities @ template.fit, spacing, geometry.yaw)
        return PatchBatch(
            tile=name,
            heightmap=heightmap,
            template=template,
            bodies=bodies,
            rows=rows,
            columns=columns,
            stride=stride,
            spacing=spacing,
            centres_w=centres_w,
            heights_w=heights,
            linear_w=linear,
            angular_w=angular,
        )


def _surface_twist(fit: FloatArray, spacing: FloatArray, yaw: float) -> tuple[FloatArray, FloatArray]:
    """Twist of rigid patches from the fit of their velocities (n, 3): at the centre, and per row and per column.

    A point at (x, y) of a patch that turns with w rises at w_x y - w_y x, so the slope of the velocity is the turning.
    """
    linear = np.zeros((len(fit), 3))
    angular = np.zeros((len(fit), 3))
    linear[:, 2] = fit[:, 0]
    per_row, per_column = fit[:, 1] / spacing, fit[:, 2] / spacing
    slope_x = per_column * math.cos(yaw) - per_row * math.sin(yaw)
    slope_y = per_column * math.sin(yaw) + per_row * math.cos(yaw)
    angular[:, 0] = slope_y
    angular[:, 1] = -slope_x
    return linear, angular
