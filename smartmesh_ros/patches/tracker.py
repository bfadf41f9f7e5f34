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
        # A patch stays as it is while the reach its body needs lies between these [m].
        self._least = np.empty(0)
        self._most = np.empty(0)

    def set_bodies(self, radii: FloatArray, kept: IntArray) -> None:
        """Says which bodies there are: bounding ``radii`` (N,) [m] and, per body, its index before or -1 (N,)."""
        known = kept >= 0
        for name, fill in (("_rings", 0), ("_stride", 0), ("_least", 0.0), ("_most", -1.0)):
            old = getattr(self, name)
            new = np.full(len(radii), fill, old.dtype)
            new[known] = old[kept[known]]
            setattr(self, name, new)
        self._radii = np.asarray(radii, np.float64)

    def configure(self, config: PatchConfig) -> None:
        """Takes other settings, from the next update on."""
        self.config = config
        self._most[:] = -1.0

    def update(self, positions_w: FloatArray, travel: FloatArray, time: float) -> list[PatchBatch]:
        """Patches at ``time`` [s] for bodies at ``positions_w`` (N, 3) [m] that may ``travel`` (N,) [m] until the next
        update. Bodies off the terrain, or whose position is not finite, get none."""
        if not len(positions_w):
            return []
        reach = self._radii + travel
        batches = []
        waiting: IntArray | None = None  # bodies without a tile yet; None = all
        for name, heightmap in self.terrain.tiles.items():
            bodies, grid = self._standing_on(heightmap, positions_w, waiting)
            if waiting is None or len(bodies) < len(waiting):
                everybody = np.arange(len(positions_w)) if waiting is None else waiting
                waiting = np.setdiff1d(everybody, bodies, assume_unique=True)
            if len(bodies):
                self._set_extent(heightmap, bodies, reach)
                batches += self._batches(name, heightmap, bodies, grid, time)
            if not len(waiting):
                break
        return batches

    def _standing_on(
        self, heightmap: HeightMap, positions_w: FloatArray, among: IntArray | None
    ) -> tuple[IntArray, FloatArray]:
        """Bodies over the map, or overlapping it from outside, and their (row, column) as fractions."""
        geometry = heightmap.geometry
        grid = geometry.to_grid(positions_w if among is None else positions_w[among])
        beyond = np.maximum(-grid, grid - (geometry.rows - 1, geometry.columns - 1)).max(axis=1)
        radii = self._radii if among is None else self._radii[among]
        # Not the other way round: this is false for positions that are not finite.
        inside = (beyond * geometry.resolution <= radii) & np.isfinite(
            positions_w[slice(None) if among is None else among, 2]
        )
        if inside.all():
            return (np.arange(len(grid)) if among is None else among), grid
        chosen = np.flatnonzero(inside)
        return (chosen if among is None else among[chosen]), grid[chosen]

    def _set_extent(self, heightmap: HeightMap, bodies: IntArray, reach: FloatArray) -> None:
        """Grows patches at once and shrinks them only well below the size they have, so that none flickers."""
        need = reach[bodies]
        outgrown = (need > self._most[bodies]) | (need < self._least[bodies])
        if not outgrown.any():
            return
        bodies = bodies[outgrown]
        geometry = heightmap.geometry
        side = min(geometry.rows, geometry.columns)
        extent = extent_for(need[outgrown], geometry.resolution, side, self.config.rings)
        self._rings[bodies], self._stride[bodies] = extent.rings, extent.stride
        self._least[bodies], self._most[bodies] = extent.least, extent.most

    def _batches(
        self, name: str, heightmap: HeightMap, bodies: IntArray, grid: FloatArray, time: float
    ) -> list[PatchBatch]:
        """The bodies by the size of their patches."""
        rings = self._rings[bodies]
        first = int(rings[0])
        if (rings == first).all():
            return [self._batch(name, heightmap, first, bodies, grid, time)]
        batches = []
        for size in np.unique(rings):
            members = rings == size
            batches.append(self._batch(name, heightmap, int(size), bodies[members], grid[members], time))
        return batches

    def _batch(
        self, name: str, heightmap: HeightMap, rings: int, bodies: IntArray, grid: FloatArray, time: float
    ) -> PatchBatch:
        geometry = heightmap.geometry
        template = patch_template(rings)
        stride = self._stride[bodies]
        with self.stopwatch.stage("search"):
            rows, columns = nearest_vertices(geometry, grid, rings * stride)
        with self.stopwatch.stage("collect"):
            centres = rows * geometry.columns + columns
            indices = template.indices(geometry.columns) * stride[:, None]
            indices += centres[:, None]
            heights, velocities = heightmap.sample(indices, centres, time)
        spacing: FloatArray = np.multiply(stride, geometry.resolution, dtype=np.float64)
        centres_w = np.empty((len(bodies), 3))
        centres_w[:, :2] = geometry.to_world(rows, columns)
        centres_w[:, 2] = heights[:, template.centre]
        twist = np.zeros((2, len(bodies), 3))
        if velocities is not None:
            _set_surface_twist(twist, velocities @ template.fit, spacing, geometry.yaw)
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
            linear_w=twist[0],
            angular_w=twist[1],
        )


def _set_surface_twist(twist: FloatArray, fit: FloatArray, spacing: FloatArray, yaw: float) -> None:
    """Twist (2, n, 3) of rigid patches from the fit of their velocities (n, 3): at the centre, per row and per column.

    A point at (x, y) of a patch that turns with w rises at w_x y - w_y x, so the slope of the velocity is the turning.
    """
    linear, angular = twist
    linear[:, 2] = fit[:, 0]
    per_row, per_column = fit[:, 1] / spacing, fit[:, 2] / spacing
    cos, sin = math.cos(yaw), math.sin(yaw)
    angular[:, 0] = per_column * sin + per_row * cos
    angular[:, 1] = per_row * sin - per_column * cos
