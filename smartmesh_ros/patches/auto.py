"""As much ground as each body needs, looked at again only when it may need another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.airborne import aloft
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.bodies import carry_over
from smartmesh_ros.patches.choice import FACET, FIELD, FIXED, NONE, SMALL_WINDOW, Choice, choose
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.grid_collect import collect_inside
from smartmesh_ros.patches.grid_search import GridSearch
from smartmesh_ros.patches.grid_window import Balls, window_rings
from smartmesh_ros.patches.lively import (
    FINE,
    LONGEST,
    OFTEN,
    UNLOOKED,
    in_vain,
    look_again,
    mostly_fields,
    mostly_unlooked,
)
from smartmesh_ros.patches.planes import foot_offset
from smartmesh_ros.patches.ranges import (
    SLACK,
    leeway,
    roaming_reach,
    roaming_room,
    room_on_planes,
    sizes_together,
    window_of,
)
from smartmesh_ros.patches.standing import Standing, turned
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.search.grid import Cells
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import HeightMap

# A choice holds for so many steps where the ground moves. Where its velocity changes it is fewer: in small windows, as
# room for that would soon mean a larger patch, and in all if so many take longer than this [s], as curved ground would
# not pass as flat.
HORIZON, SHORT_HORIZON, LONG = 8, 4, 0.05
# A look costs about the same for one body as for many: who has used up this share of a choice goes with others.
EARLY = 0.5
# On a patch to roam on, how much nearer to the ground bodies may come before that is looked at again [radii].
NEARER = 0.1
# A plane that deviates by less than this share of the tolerance is as good as the ground.
CURVED = 0.1
# What a body gains in a step by falling, at most [m/s^2].
FALL = 10.0
HURRY = 24
# Ground that accelerates by more is not waited for [m/s^2].
SWERVE = 20.0

_FILLS = {
    "_normal": (0.0, 0.0, 1.0),
    "_lean": 0.0,
    "_rise": 0.0,
    "_where": 0.0,
    "_since": 0.0,
    "_drop": 0.0,
    "_slide": 0.0,
    "_version": -1,
    "_window": 0,
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


class Way(NamedTuple):
    """How far n bodies come ``across`` the ground and go ``along`` it in a step, and how far they may until the next
    look (``drop``, ``slide``), shapes (n,) [m]."""

    across: FloatArray
    along: FloatArray
    drop: FloatArray
    slide: FloatArray


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
        self._standing = Standing()
        self._time = -np.inf
        self._lively = False
        # What ground at rest gave, by tile.
        self._at_rest: dict[str, tuple[IntArray, list[PatchBatch], IntArray]] = {}
        # The ground under the body: normal in the world, offset of the body from its foot in the grid's frame [m], and
        # vertical velocity [m/s].
        self._normal, self._lean, self._rise = np.empty((0, 3)), np.empty((0, 2)), np.empty(0)
        # Where and when the choice was made, and for how much approach and sliding [m].
        self._where, self._since = np.empty((0, 3)), np.empty(0)
        self._drop, self._slide = np.empty(0), np.empty(0)
        # Of which version of the map, and how many rings of it were looked at.
        self._version, self._window = np.empty(0, np.int64), np.empty(0, np.int64)

    def set_bodies(self, kept: IntArray) -> None:
        """Says which bodies there are, by their index before, -1 = new (N,)."""
        carry_over(self, _FILLS, kept)
        self._standing.set_bodies(kept)
        self._at_rest.clear()

    def forget(self, bodies: IntArray | slice) -> None:
        """Has bodies looked at anew."""
        self._standing.forget(bodies)
        self._normal[bodies] = (0.0, 0.0, 1.0)
        self._lean[bodies] = 0.0

    def patches(
        self, name: str, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch],
        *, lively: bool,
    ) -> tuple[list[PatchBatch], IntArray]:  # fmt: skip
        """Patches on the tile ``name`` at ``time`` [s] for steps of ``dt`` [s], and which of ``moving`` need one of
        fixed extent instead (m,): at the tile's edge, and where looking would be in vain as ground is ``lively``."""
        bodies, standing, method = moving.bodies, self._standing, self.config.collect
        if time < self._time:  # the clock was set anew: what holds until some time holds no more
            self.forget(slice(None))
            self._at_rest.clear()
        self._time = time
        if ((standing.state[bodies] == FIXED) & (standing.until[bodies] > time)).all():
            return [], np.arange(len(bodies))
        moves = heightmap.moving(time)
        self._lively = moves and (lively or heightmap.lifetime <= OFTEN * dt) and self.config.kind == "auto"
        rest = None if moves else self._at_rest.get(name)
        if moves:
            standing.follow(heightmap, bodies, time, method)
            self._at_rest.pop(name, None)
        elif rest is None:
            standing.forget(bodies)
        due = self._due(heightmap, moving, time, dt)
        if due.any():
            self._decide(heightmap, moving.of(due), time, dt, before)
        elif rest is not None and np.array_equal(rest[0], bodies):
            return list(rest[1]), rest[2]
        with self._stopwatch.stage("collect"):
            batches, fixed = standing.batches(name, heightmap, bodies, moving.positions_w, time, method)
        if not moves:
            self._at_rest[name] = (bodies, list(batches), fixed)
        return batches, fixed

    def _due(self, heightmap: HeightMap, moving: Moving, time: float, dt: float) -> BoolArray:
        """Which bodies to look at (n,): those whose choice may not hold until the end of the step."""
        bodies = moving.bodies
        until = self._standing.until[bodies]
        shift = moving.positions_w + moving.moved_w - self._where[bodies]
        shift[:, 2] -= self._rise[bodies] * (time + dt - self._since[bodies])
        drop = np.einsum("ij,ij->i", shift, self._normal[bodies])
        slide = np.einsum("ij,ij->i", shift, shift)
        drop *= drop
        slide -= drop
        most_drop, most_slide = self._drop[bodies] ** 2, self._slide[bodies] ** 2
        due = (time >= until) | (drop > most_drop) | (slide > most_slide)
        steady = heightmap.moving(time) and heightmap.lifetime <= HORIZON * dt
        changed = self._changed(heightmap, bodies)
        due |= changed & np.isinf(until) if steady else changed
        if due.any():
            due |= (drop > EARLY * EARLY * most_drop) | (slide > EARLY * EARLY * most_slide)
            vain = self._standing.state[bodies] == FIXED
            since = self._since[bodies]
            due |= ~vain & (time + dt - since >= EARLY * (until - since))
        return np.asarray(due)

    def _changed(self, heightmap: HeightMap, bodies: IntArray) -> BoolArray:
        """Under which bodies there is other ground than they were looked at with (n,)."""
        version, standing = self._version[bodies], self._standing
        if (version == heightmap.version).all():
            return np.zeros(len(bodies), bool)
        rows, columns = standing.rows[bodies], standing.columns[bodies]
        return heightmap.clocks.changed(rows, columns, self._window[bodies], version)

    def _look_up(self, heightmap: HeightMap, moving: Moving, time: float, dt: float) -> BoolArray:
        """Looks at those of the bodies (n,) that were in the air: which stay there, how far and for how long; on lively
        ground the others get a patch of fixed extent. Says which bodies were not dealt with (n,)."""
        standing = self._standing
        high = np.asarray(standing.state[moving.bodies] == NONE)
        if not high.any():
            return ~high
        moving = moving.of(high)
        bottoms_w = moving.positions_w[:, 2] - moving.radii - 2.0 * FALL * dt * dt
        along = np.hypot(moving.moved_w[:, 0], moving.moved_w[:, 1])
        room = aloft(heightmap, moving.grid, bottoms_w, moving.radii, along, time, self.config.collect)
        stay = (
            (room.above > SLACK + np.abs(moving.moved_w[:, 2]))
            & (room.aside > along)
            & (room.lasts >= SHORT_HORIZON * dt)
        )
        bodies = moving.bodies[stay]
        standing.rows[bodies], standing.columns[bodies] = room.cells.rows[stay], room.cells.columns[stay]
        standing.until[bodies] = time + room.lasts[stay] - 0.5 * dt
        self._window[bodies], self._version[bodies] = room.rings[stay], heightmap.version
        self._where[bodies], self._since[bodies] = moving.positions_w[stay], time
        self._drop[bodies], self._slide[bodies] = room.above[stay], room.aside[stay]
        self._normal[bodies], self._lean[bodies], self._rise[bodies] = (0.0, 0.0, 1.0), 0.0, room.rise[stay]
        if (self._lively and mostly_fields(standing.state)) or mostly_unlooked(standing.state):
            stay |= self._leave_alone(
                moving, ~stay & (moving.radii + along <= FINE * heightmap.geometry.resolution), time
            )
        high[high] = stay
        return ~high

    def _leave_alone(self, moving: Moving, vain: BoolArray, time: float) -> BoolArray:
        """Gives bodies where it is ``vain`` (n,) to look a patch of fixed extent for a while."""
        standing, bodies = self._standing, moving.bodies[vain]
        unlooked = np.clip(2.0 * standing.unlooked[bodies], UNLOOKED, LONGEST)
        standing.unlooked[moving.bodies] = 0.0
        standing.unlooked[bodies] = unlooked
        standing.state[bodies], standing.until[bodies] = FIXED, look_again(time, unlooked)
        self._drop[bodies] = self._slide[bodies] = np.inf
        return vain

    def _decide(self, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch]) -> None:
        left = self._look_up(heightmap, moving, time, dt)
        if not left.all():
            moving = moving.of(left)
            if not moving.bodies.size:
                return
        geometry, bodies = heightmap.geometry, moving.bodies
        with self._stopwatch.stage("search"):
            foot = moving.grid - self._lean[bodies][:, ::-1] / geometry.resolution
            cells = self._search.nearest(self.config.search, geometry, bodies, foot, moving.positions_w, before)
        # Motion relative to the ground, across and along it, in one step.
        shift = moving.moved_w.copy()
        shift[:, 2] -= self._rise[bodies] * dt
        across = np.abs(np.einsum("ij,ij->i", shift, self._normal[bodies]))
        along = np.sqrt(np.maximum(np.einsum("ij,ij->i", shift, shift) - across * across, 0.0))
        drop, slide = leeway(across, along, moving.radii)
        reach = moving.radii + drop + slide + FALL * dt * dt + np.abs(self._lean[bodies]).max(axis=1)
        if not heightmap.moving(time):
            reach = roaming_reach(reach, moving.radii, geometry.resolution)
        rings = window_rings(reach, geometry.resolution)
        standing = self._standing
        standing.rows[bodies], standing.columns[bodies] = cells
        standing.middles_w[bodies] = geometry.to_world(*cells)
        inside = (cells.rows >= rings) & (cells.rows < geometry.rows - rings)
        inside &= (cells.columns >= rings) & (cells.columns < geometry.columns - rings)
        # The search leaves the rim out: the nearest vertex found may not be that.
        inside &= np.maximum(np.abs(foot[:, 0] - cells.rows), np.abs(foot[:, 1] - cells.columns)) <= 0.5 + 1e-9
        standing.state[bodies[~inside]] = FIXED
        standing.until[bodies[~inside]] = -np.inf
        with self._stopwatch.stage("collect"):
            sizes = sizes_together(geometry, cells, np.where(inside, rings, 0))
            for size in np.unique(sizes[inside]).tolist():
                rows = np.flatnonzero(sizes == size)
                way = Way(across[rows], along[rows], drop[rows], slide[rows])
                self._decide_size(heightmap, size, moving.of(rows), way, time, dt)
        self._version[bodies] = heightmap.version
        self._window[bodies] = rings

    def _decide_size(
        self,
        heightmap: HeightMap,
        size: int,
        moving: Moving,
        way: Way,
        time: float,
        dt: float,
    ) -> None:
        """Decides for bodies with windows of ``size`` rings."""
        geometry, bodies, standing = heightmap.geometry, moving.bodies, self._standing
        cells = Cells(standing.rows[bodies], standing.columns[bodies])
        ones = np.ones_like(bodies)
        ground = collect_inside(heightmap, patch_template(size), cells, ones, time, self.config.collect)
        rise = np.zeros(len(bodies))
        if ground.velocities is not None:
            rise = np.nan_to_num(ground.velocities[:, patch_template(size).centre])
        changing = self._changing(bodies, rise, time, dt)
        horizon = np.full(len(bodies), HORIZON)
        if size <= SMALL_WINDOW or HORIZON * dt > LONG:
            horizon[~(0.5 * (HORIZON * dt) ** 2 * changing <= SLACK)] = SHORT_HORIZON
        ahead = horizon * dt
        window = window_of(geometry, size, ground, ahead)
        centres = np.empty((len(bodies), 3))
        centres[:, 0] = (moving.grid[:, 1] - cells.columns) * geometry.resolution
        centres[:, 1] = (moving.grid[:, 0] - cells.rows) * geometry.resolution
        centres[:, 2] = moving.positions_w[:, 2]
        swerve = 0.5 * ahead * ahead * np.nan_to_num(changing)  # from where the ground's velocity leads
        across, along, drop, slide = way
        drop = drop + swerve
        balls = Balls(centres=centres, radii=moving.radii + drop + FALL * dt * dt, lateral=slide)
        choice = choose(
            window, balls, self._lean[bodies], self.config,
            standing.state[bodies], standing.rings[bodies], standing.stride[bodies], standing.spare[bodies],
        )  # fmt: skip
        if ground.velocities is None and not ground.holes:
            room, deviation = room_on_planes(window, choice, balls, centres, self.config.plane_tolerance)
            slide = np.maximum(slide, room)
            soon = np.where(standing.state[bodies] == FIELD, 1.5, 1.0) * HORIZON * along
            hurried = (slide < soon) & (choice.deviation > CURVED * self.config.plane_tolerance)
            roam = roaming_room(choice, moving.radii, centres, window, hurried)
            drop, slide = np.where(roam > slide, np.maximum(drop, NEARER * moving.radii), drop), np.maximum(slide, roam)
            planar = (room > 0.0) & (choice.state != FIELD)
            choice.deviation[planar] = np.maximum(choice.deviation, deviation)[planar]
        before = standing.state[bodies]
        known = self._note(bodies, choice, centres, moving.radii, geometry.yaw)
        standing.rate[bodies], self._rise[bodies] = 0.0, rise
        standing.until[bodies] = np.inf
        if ground.velocities is not None:
            now, later = choice.planes_at(0), choice.planes_at(1)
            standing.rate[bodies] = (np.stack(later, axis=1) - np.stack(now, axis=1)) / ahead[:, None]
            moves = ground.velocities.any(axis=1)
            standing.until[bodies] = np.where(moves, time + (horizon - 0.5) * dt, np.inf)
        standing.read_at[bodies], standing.read_from[bodies] = time, heightmap.version
        self._where[bodies], self._since[bodies] = moving.positions_w, time
        # Where the ground's normal is not known, sliding may be an approach.
        self._drop[bodies], self._slide[bodies] = drop, np.where(known, slide, np.minimum(slide, drop))
        hurried = slide < HURRY * along
        if ground.velocities is not None:
            hurried = np.asarray(moves & self._lively)
        if hurried.any() and mostly_fields(standing.state) and self.config.kind == "auto":
            crowd = mostly_unlooked(standing.state)
            vain = in_vain(choice, before, centres, moving.radii, across / dt, crowd=crowd)
            vain &= (hurried | crowd) & (moving.radii + along <= FINE * geometry.resolution)
            self._leave_alone(moving, vain, time)

    def _changing(self, bodies: IntArray, rise: FloatArray, time: float, dt: float) -> FloatArray:
        """How fast the ground's velocity ``rise`` (n,) [m/s] has changed since the last look (n,) [m/s^2], NaN where
        that is too long ago."""
        since = time - self._since[bodies]
        recent = (since > 0.0) & (since <= 2.0 * HORIZON * dt)
        change = np.abs(rise - self._rise[bodies])
        return np.where(recent, np.minimum(change / np.where(recent, since, 1.0), SWERVE), np.nan)

    def _note(self, bodies: IntArray, choice: Choice, centres: FloatArray, radii: FloatArray, yaw: float) -> BoolArray:
        """Notes what was chosen for ``bodies`` (n,) at ``centres`` (n, 3) [m] of their windows, and how the ground
        runs; says for which bodies that is known (n,)."""
        standing, planes = self._standing, choice.planes_at(0)
        standing.state[bodies] = choice.state
        standing.rings[bodies], standing.stride[bodies] = choice.rings, choice.stride
        standing.spare[bodies] = choice.spare
        standing.deviation[bodies], standing.facet[bodies] = choice.deviation, choice.facets
        standing.plane[bodies] = np.stack(planes, axis=1)
        offsets = foot_offset(planes, centres)
        near = np.asarray(np.einsum("ij,ij->i", offsets, offsets) < (2.0 * radii) ** 2)  # not where there is a hole
        known = near[:, None]
        self._normal[bodies] = np.where(known, turned(planes.normals(), yaw), (0.0, 0.0, 1.0))
        # On curved ground the foot decides over the plane and the plane over the foot: half a step each time settles.
        lean, half = self._lean[bodies], np.where(choice.state == FACET, 1.0, 0.5)[:, None]
        self._lean[bodies] = np.where(known, lean + half * (offsets - lean), 0.0)
        return near
