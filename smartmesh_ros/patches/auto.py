"""As much ground as each body needs, looked at again only when it may need another."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.batch import GridBatch, PatchBatch, PlaneBatch, grid_twist
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.choice import EDGE, FACET, FACET_RINGS, FIELD, FITTED, NONE, UNDECIDED, choose, foot_offset
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.facets import facet_index, facet_planes, facets_of
from smartmesh_ros.patches.grid_collect import collect_inside
from smartmesh_ros.patches.grid_search import GridSearch
from smartmesh_ros.patches.grid_window import Balls, Window, window_rings
from smartmesh_ros.patches.planes import Planes, fitted_planes
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

# A choice holds while the body has come no nearer to the ground than this, beyond what its speed says [m], for so many
# steps where the ground moves, and for half as much travel in any case. Both are smaller where a body touches few
# cells: steep ones meet within a few millimetres of it, and large margins would leave no plane.
SLACK, FEW_SLACK = 0.0005, 0.0001
HORIZON, FEW_HORIZON = 8, 2
FEW_RINGS = 2
# For no more bodies than this, looking less often saves more than planes do.
FEW_BODIES = 64
# A look costs about the same for one body as for many: who has used up this share of a choice goes with others.
EARLY = 0.4
# What a body gains in a step by falling, at most [m/s^2].
FALL = 10.0

_FILLS = {
    "_state": UNDECIDED,
    "_rows": 0,
    "_columns": 0,
    "_rings": 0,
    "_stride": 0,
    "_deviation": np.nan,
    "_facet": 0,
    "_plane": 0.0,
    "_rate": 0.0,
    "_normal": (0.0, 0.0, 1.0),
    "_lean": 0.0,
    "_rise": 0.0,
    "_where": 0.0,
    "_since": 0.0,
    "_until": -np.inf,
    "_drop": 0.0,
    "_slide": 0.0,
    "_version": -1,
}


class Moving(NamedTuple):
    """n bodies by their index: fractional (row, column) (n, 2), positions (n, 3) [m], bounding radii (n,) [m], and how
    far they moved in the last step (n, 3) [m]."""

    bodies: IntArray
    grid: FloatArray
    positions_w: FloatArray
    radii: FloatArray
    moved_w: FloatArray

    def of(self, rows: IntArray | BoolArray) -> Moving:
        """Those in ``rows``."""
        return Moving(self.bodies[rows], self.grid[rows], self.positions_w[rows], self.radii[rows], self.moved_w[rows])


class AutoPatches:
    """Chooses for each body and keeps the choice while it holds.

    A choice is made for a ball: the body's bounding sphere, larger by how near it may come to the ground until the next
    look (`SLACK` and some steps of its motion relative to the ground), and for how far it may slide. It is made again
    when the body moved further than that, after `HORIZON` steps on moving ground, and when a new map came, unless maps
    come so steadily that the ground is known ahead for that long.
    """

    def __init__(self, config: PatchConfig, search: GridSearch, stopwatch: Stopwatch) -> None:
        self.config = config
        self._search = search
        self._stopwatch = stopwatch
        self._state = np.empty(0, np.int64)
        # The patch: its middle sample, rings and stride, and how far it lies from the mesh [m].
        self._rows, self._columns = np.empty(0, np.int64), np.empty(0, np.int64)
        self._rings, self._stride = np.empty(0, np.int64), np.empty(0, np.int64)
        self._deviation = np.empty(0)
        # The facet (upper or lower, row and column of its cell by the middle sample); the plane along the ground with
        # the velocity of its coefficients.
        self._facet = np.empty((0, 3), np.int64)
        self._plane, self._rate = np.empty((0, 3)), np.empty((0, 3))
        # The ground under the body: normal in the world, offset of the body from its foot in the grid's frame [m], and
        # vertical velocity [m/s].
        self._normal, self._lean, self._rise = np.empty((0, 3)), np.empty((0, 2)), np.empty(0)
        # Where and when the choice was made, until when it holds, and for how much approach and sliding [m].
        self._where, self._since, self._until = np.empty((0, 3)), np.empty(0), np.empty(0)
        self._drop, self._slide = np.empty(0), np.empty(0)
        self._version = np.empty(0, np.int64)

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)

    def forget(self, bodies: IntArray | slice) -> None:
        """Has bodies looked at anew."""
        self._state[bodies] = UNDECIDED
        self._normal[bodies] = (0.0, 0.0, 1.0)
        self._lean[bodies] = 0.0

    def patches(
        self, name: str, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch]
    ) -> tuple[list[PatchBatch], IntArray]:
        """Patches on the tile ``name`` at ``time`` [s] for steps of ``dt`` [s], and which of ``moving`` are so near to
        the tile's edge that they need a patch that ends there (m,)."""
        due = self._due(heightmap, moving, time, dt)
        if due.any():
            self._decide(heightmap, moving.of(due), time, dt, before)
        bodies = moving.bodies
        state = self._state[bodies]
        batches: list[PatchBatch] = []
        plane = (state == FACET) | (state == FITTED)
        if plane.any():
            batches.append(self._planes(name, heightmap, moving.of(plane), time))
        field = state == FIELD
        if field.any():
            rings = self._rings[bodies]
            batches += [
                self._field(name, heightmap, size, moving.of(field & (rings == size)), time)
                for size in np.unique(rings[field]).tolist()
            ]
        return batches, np.flatnonzero(state == EDGE)

    def _due(self, heightmap: HeightMap, moving: Moving, time: float, dt: float) -> BoolArray:
        """Which bodies to look at (n,): those whose choice may not hold until the end of the step."""
        bodies = moving.bodies
        rise, until = self._rise[bodies], self._until[bodies]
        shift = moving.positions_w + moving.moved_w - self._where[bodies]
        shift[:, 2] -= rise * (time + dt - self._since[bodies])
        drop = np.einsum("ij,ij->i", shift, self._normal[bodies])
        slide = np.einsum("ij,ij->i", shift, shift) - drop * drop
        most_drop, most_slide = self._drop[bodies], self._slide[bodies] ** 2
        np.abs(drop, out=drop)
        due = (self._state[bodies] == UNDECIDED) | (time >= until) | (drop > most_drop) | (slide > most_slide)
        steady = heightmap.moving(time) and heightmap.lifetime <= HORIZON * dt
        if not steady:
            due |= self._version[bodies] != heightmap.version
        if due.any():
            due |= (drop > EARLY * most_drop) | (slide > EARLY * EARLY * most_slide)
            due |= time + (1.0 - EARLY) * FEW_HORIZON * dt >= until
        return np.asarray(due)

    def _decide(self, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch]) -> None:
        geometry, bodies = heightmap.geometry, moving.bodies
        with self._stopwatch.stage("search"):
            foot = moving.grid - self._lean[bodies][:, ::-1] / geometry.resolution
            cells = self._search.nearest(self.config.search, geometry, bodies, foot, moving.positions_w, before)
        # Motion relative to the ground, across and along it, in one step.
        shift = moving.moved_w.copy()
        shift[:, 2] -= self._rise[bodies] * dt
        across = np.abs(np.einsum("ij,ij->i", shift, self._normal[bodies]))
        along = np.sqrt(np.maximum(np.einsum("ij,ij->i", shift, shift) - across * across, 0.0))
        looks = 0.5 * HORIZON
        reach = moving.radii + SLACK + looks * (across + along) + FALL * dt * dt
        reach += np.abs(self._lean[bodies]).max(axis=1)
        rings = window_rings(reach, geometry.resolution)
        self._rows[bodies], self._columns[bodies] = cells
        inside = (cells.rows >= rings) & (cells.rows < geometry.rows - rings)
        inside &= (cells.columns >= rings) & (cells.columns < geometry.columns - rings)
        # The search leaves the rim out: the nearest vertex found may not be that.
        inside &= np.maximum(np.abs(foot[:, 0] - cells.rows), np.abs(foot[:, 1] - cells.columns)) <= 0.5 + 1e-9
        self._state[bodies[~inside]] = EDGE
        self._until[bodies[~inside]] = -np.inf
        with self._stopwatch.stage("collect"):
            for size in np.unique(rings[inside]).tolist():
                rows = np.flatnonzero(inside & (rings == size))
                self._decide_size(heightmap, size, moving.of(rows), across[rows], along[rows], time, dt)
        self._version[bodies] = heightmap.version

    def _decide_size(
        self,
        heightmap: HeightMap,
        size: int,
        moving: Moving,
        across: FloatArray,
        along: FloatArray,
        time: float,
        dt: float,
    ) -> None:
        """Decides for bodies with windows of ``size`` rings, which come ``across`` and go ``along`` (n,) [m] in a
        step."""
        geometry, bodies = heightmap.geometry, moving.bodies
        cells = Cells(self._rows[bodies], self._columns[bodies])
        ones = np.ones_like(bodies)
        ground = collect_inside(heightmap, patch_template(size), cells, ones, time, self.config.collect)
        shape = (len(bodies), 2 * size + 1, 2 * size + 1)
        heights = ground.heights.reshape(shape)
        rates = None if ground.velocities is None else ground.velocities.reshape(shape)
        few = size <= FEW_RINGS and rates is not None and len(self._state) > FEW_BODIES
        horizon, slack = (FEW_HORIZON, FEW_SLACK) if few else (HORIZON, SLACK)
        ahead = None if rates is None else heights + rates * (horizon * dt)
        window = Window(heights=heights, ahead=ahead, rings=size, resolution=geometry.resolution, holes=ground.holes)
        centres = self._in_windows(geometry.resolution, moving)
        drop, slide = slack + 0.5 * horizon * across, slack + 0.5 * horizon * along
        balls = Balls(centres=centres, radii=moving.radii + drop + FALL * dt * dt, lateral=slide)
        choice = choose(
            window, balls, self._lean[bodies], self.config,
            self._state[bodies], self._rings[bodies], self._stride[bodies],
        )  # fmt: skip
        self._state[bodies] = choice.state
        self._rings[bodies], self._stride[bodies] = choice.rings, choice.stride
        self._deviation[bodies] = choice.deviation
        self._plane[bodies] = np.stack(choice.planes, axis=1)
        self._facet[bodies] = choice.facets
        self._rise[bodies] = 0.0 if rates is None else rates[:, size, size]
        self._rate[bodies] = 0.0
        if rates is not None:
            self._rate[bodies] = _rate_under(window, rates, choice.planes, centres)
        normals, offsets = choice.planes.normals(), foot_offset(choice.planes, centres)
        known = np.einsum("ij,ij->i", offsets, offsets) < (2.0 * moving.radii) ** 2  # not where there is a hole
        self._normal[bodies] = np.where(known[:, None], _turned(normals, geometry.yaw), (0.0, 0.0, 1.0))
        # On curved ground the foot decides over the plane and the plane over the foot: half a step each time settles.
        half = np.where(choice.state == FACET, 1.0, 0.5)[:, None]
        self._lean[bodies] += np.where(known[:, None], half * (offsets - self._lean[bodies]), -self._lean[bodies])
        self._where[bodies], self._since[bodies] = moving.positions_w, time
        self._until[bodies] = np.inf if rates is None else time + (horizon - 0.5) * dt
        self._drop[bodies], self._slide[bodies] = drop, slide
        clear = choice.state == NONE
        if clear.any():
            # As much approach as there is room above all ground around.
            top = np.nan_to_num(heights[clear], nan=np.inf).max(axis=(1, 2))
            room = moving.positions_w[clear, 2] - moving.radii[clear] - top - 2.0 * FALL * dt * dt
            self._drop[bodies[clear]] = np.maximum(self._drop[bodies[clear]], room)

    def _planes(self, name: str, heightmap: HeightMap, moving: Moving, time: float) -> PlaneBatch:
        """Patches whose collider is a plane: 3 x 3 samples for the outputs, and the plane itself."""
        geometry, bodies, template = heightmap.geometry, moving.bodies, patch_template(1)
        cells, stride = Cells(self._rows[bodies], self._columns[bodies]), self._stride[bodies]
        with self._stopwatch.stage("collect"):
            ground = collect_inside(heightmap, template, cells, stride, time, self.config.collect)
        spacing: FloatArray = np.multiply(stride, geometry.resolution, dtype=np.float64)
        fitted, facets = self._state[bodies] == FITTED, self._facet[bodies]
        coefficients = _planes_of(ground.heights, fitted, facets, spacing, geometry.resolution)
        centres_w = np.empty((len(bodies), 3))
        centres_w[:, :2] = geometry.to_world(cells.rows, cells.columns)
        centres_w[:, 2] = coefficients[:, 0]
        twist = np.zeros((2, len(bodies), 3))
        if ground.velocities is not None:
            rates = _planes_of(ground.velocities, fitted, facets, spacing, geometry.resolution)
            grid_twist(rates[:, [0, 2, 1]], np.ones(1), geometry.yaw, twist)
        points_w, normals_w = self._feet(heightmap, moving, coefficients)
        return PlaneBatch(
            tile=name, kind="plane", bodies=bodies, triangles=template.triangles, rows=cells.rows,
            columns=cells.columns, stride=stride, centres_w=centres_w, linear_w=twist[0], angular_w=twist[1],
            deviation=self._deviation[bodies], heightmap=heightmap, template=template, spacing=spacing,
            heights_w=ground.heights, holes=False, normals_w=normals_w, points_w=points_w,
        )  # fmt: skip

    def _field(self, name: str, heightmap: HeightMap, rings: int, moving: Moving, time: float) -> GridBatch:
        bodies, template = moving.bodies, patch_template(rings)
        cells, stride = Cells(self._rows[bodies], self._columns[bodies]), self._stride[bodies]
        with self._stopwatch.stage("collect"):
            ground = collect_inside(heightmap, template, cells, stride, time, self.config.collect)
        plane = self._plane[bodies] + self._rate[bodies] * (time - self._since[bodies])[:, None]
        points_w, normals_w = self._feet(heightmap, moving, plane)
        return GridBatch.of(
            name, "heightfield", bodies, heightmap, template, cells, stride, ground, self._deviation[bodies],
            points_w=points_w, normals_w=normals_w,
        )  # fmt: skip

    def _in_windows(self, resolution: float, moving: Moving) -> FloatArray:
        """Positions of bodies in the frames of their windows (n, 3) [m]."""
        centres = np.empty((len(moving.bodies), 3))
        centres[:, 0] = (moving.grid[:, 1] - self._columns[moving.bodies]) * resolution
        centres[:, 1] = (moving.grid[:, 0] - self._rows[moving.bodies]) * resolution
        centres[:, 2] = moving.positions_w[:, 2]
        return centres

    def _feet(self, heightmap: HeightMap, moving: Moving, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points of planes (n, 3), given around the patches' middles, that are nearest to the bodies, and normals."""
        geometry = heightmap.geometry
        planes = Planes(*plane.T)
        centres = self._in_windows(geometry.resolution, moving)
        distance: FloatArray = planes.above(centres) / np.sqrt(1.0 + planes.slope_x**2 + planes.slope_y**2)
        normals_w = _turned(planes.normals(), geometry.yaw)
        return moving.positions_w - distance[:, None] * normals_w, normals_w


def _rate_under(window: Window, rates: FloatArray, planes: Planes, centres: FloatArray) -> FloatArray:
    """How the coefficients of the facet under each body change (n, 3) [m/s, 1/s, 1/s]."""
    rows = np.arange(len(centres))
    moving = Window(heights=rates, rings=window.rings, resolution=window.resolution, holes=window.holes)
    foot = centres[:, :2] - foot_offset(planes, centres)
    facets = facets_of(moving.inner(rows, FACET_RINGS))
    found = np.stack(facet_planes(facets, *facet_index(facets, *np.nan_to_num(foot).T)), axis=1)
    return np.nan_to_num(found) if window.holes else found


def _planes_of(
    samples: FloatArray, fitted: BoolArray, facets: IntArray, spacing: FloatArray, resolution: float
) -> FloatArray:
    """Planes (n, 3) through 3 x 3 ``samples`` (n, 9), fitted to all of them or those of ``facets`` (n, 3)."""
    planes = np.empty((len(samples), 3))
    if fitted.any():
        planes[fitted] = np.stack(fitted_planes(samples[fitted], spacing[fitted]), axis=1)
    single = ~fitted
    if single.any():
        window = Window(heights=samples[single].reshape(-1, 3, 3), rings=1, resolution=resolution)
        planes[single] = np.stack(facet_planes(facets_of(window), *facets[single].T), axis=1)
    return planes


def _turned(vectors: FloatArray, yaw: float) -> FloatArray:
    """Vectors (n, 3) of the grid's frame in the world's."""
    if not yaw:
        return vectors
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y, z = vectors.T
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
