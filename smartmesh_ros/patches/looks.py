"""Looking at the ground around bodies, and noting what they get and for how long that will do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.airborne import aloft
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.choice import FACET, FIELD, FIXED, NONE, SMALL_WINDOW, Choice, choose
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.grid_collect import Collected, collect_inside
from smartmesh_ros.patches.grid_search import GridSearch
from smartmesh_ros.patches.grid_window import Balls, Window, window_rings
from smartmesh_ros.patches.lively import (
    HURRY,
    in_vain,
    look_again,
    mostly_fields,
    mostly_unlooked,
    reaches_few,
    unlooked_for,
)
from smartmesh_ros.patches.looked import Looked
from smartmesh_ros.patches.moving import Moving
from smartmesh_ros.patches.planes import foot_offset
from smartmesh_ros.patches.ranges import (
    HORIZON,
    SHORT_HORIZON,
    SLACK,
    leeway,
    rings_to_edge,
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

# If the horizon of a look is longer [s], it is the short one where the ground's velocity changes.
LONG = 0.05
# On a patch to roam on, how much nearer to the ground bodies may come before that is looked at again [radii].
NEARER = 0.1
# A plane that deviates by less than this share of the tolerance is as good as the ground.
CURVED = 0.1
# What a body gains until the next update by falling, at most [m/s^2].
FALL = 10.0


class Way(NamedTuple):
    """How far n bodies come ``across`` the ground and go ``along`` it until the next update, and how far they may until
    the next look (``drop``, ``slide``), shapes (n,) [m]."""

    across: FloatArray
    along: FloatArray
    drop: FloatArray
    slide: FloatArray

    def of(self, rows: BoolArray) -> Way:
        """Those in ``rows``."""
        return Way(self.across[rows], self.along[rows], self.drop[rows], self.slide[rows])


class View(NamedTuple):
    """What is seen of the ground around n bodies: the samples and the window they make, the balls in it, the ground's
    vertical velocity in the middle (n,) [m/s], and for how many seconds it is seen ahead (n,)."""

    ground: Collected
    window: Window
    balls: Balls
    rise: FloatArray
    ahead: FloatArray


class Looks:
    """Looks at bodies when they are due, and notes the choices in `Standing` and what they hold for in `Looked`."""

    def __init__(
        self, config: PatchConfig, standing: Standing, looked: Looked, search: GridSearch, stopwatch: Stopwatch
    ) -> None:
        self.config = config
        self._standing = standing
        self._looked = looked
        self._search = search
        self._stopwatch = stopwatch

    def look(
        self, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch], *, lively: bool
    ) -> None:
        """Looks at bodies; where ground is ``lively`` some are left unlooked for a while. ``before``: the batches of
        the update before."""
        left = self._look_up(heightmap, moving, time, dt, lively=lively)
        if not left.all():
            moving = moving.of(left)
        if moving.bodies.size:
            self._look_down(heightmap, moving, time, dt, before, lively=lively)

    def _look_up(self, heightmap: HeightMap, moving: Moving, time: float, dt: float, *, lively: bool) -> BoolArray:
        """Looks at those of the bodies (n,) that were in the air: which stay there, how far and for how long; where
        most bodies are left unlooked the others are, too. Says which bodies were not dealt with (n,)."""
        standing, looked = self._standing, self._looked
        high = np.asarray(standing.state[moving.bodies] == NONE)
        if not high.any():
            return ~high
        moving = moving.of(high)
        along, falling = np.hypot(moving.moved_w[:, 0], moving.moved_w[:, 1]), np.abs(moving.moved_w[:, 2])
        bottoms_w = moving.positions_w[:, 2] - moving.radii - 2.0 * FALL * dt * dt
        room = aloft(heightmap, moving.grid, bottoms_w, moving.radii, along, time, self.config.collect)
        stay = (room.above > SLACK + falling) & (room.aside > along) & (room.lasts >= SHORT_HORIZON * dt)
        bodies = moving.bodies[stay]
        standing.rows[bodies], standing.columns[bodies] = room.cells.rows[stay], room.cells.columns[stay]
        standing.until[bodies] = time + room.lasts[stay] - 0.5 * dt
        looked.window[bodies], looked.version[bodies] = room.rings[stay], heightmap.version
        looked.where[bodies], looked.since[bodies] = moving.positions_w[stay], time
        looked.drop[bodies], looked.slide[bodies] = room.above[stay], room.aside[stay]
        looked.normal[bodies], looked.lean[bodies], looked.rise[bodies] = (0.0, 0.0, 1.0), 0.0, room.rise[stay]
        if self.config.kind == "auto" and (
            mostly_unlooked(standing.state) or (lively and mostly_fields(standing.state))
        ):
            fine = reaches_few(moving.radii + along, heightmap.geometry.resolution)
            self._leave_alone(moving, fine & ~stay, time)
            stay |= fine
        high[high] = stay
        return ~high

    def _leave_alone(self, moving: Moving, vain: BoolArray, time: float) -> None:
        """Gives bodies where it is ``vain`` (n,) to look a patch of fixed extent for a while."""
        standing, looked, bodies = self._standing, self._looked, moving.bodies[vain]
        unlooked = unlooked_for(standing.unlooked[bodies])
        standing.unlooked[moving.bodies] = 0.0
        standing.unlooked[bodies] = unlooked
        standing.state[bodies], standing.until[bodies] = FIXED, look_again(time, unlooked)
        looked.drop[bodies] = looked.slide[bodies] = np.inf

    def _look_down(
        self, heightmap: HeightMap, moving: Moving, time: float, dt: float, before: list[PatchBatch], *, lively: bool
    ) -> None:
        """Looks at the ground under bodies, in windows of the size that each needs."""
        geometry, bodies, standing, looked = heightmap.geometry, moving.bodies, self._standing, self._looked
        with self._stopwatch.stage("search"):
            foot = moving.grid - looked.lean[bodies][:, ::-1] / geometry.resolution
            cells = self._search.nearest(self.config.search, geometry, bodies, foot, moving.positions_w, before)
        across, along = looked.step(moving, dt)
        way = Way(across, along, *leeway(across, along, moving.radii))
        reach = moving.radii + way.drop + way.slide + FALL * dt * dt + np.abs(looked.lean[bodies]).max(axis=1)
        if not heightmap.moving(time):
            reach = roaming_reach(reach, moving.radii, geometry.resolution)
        rings = window_rings(reach, geometry.resolution)
        standing.rows[bodies], standing.columns[bodies] = cells
        standing.middles_w[bodies] = geometry.to_world(*cells)
        inside = rings_to_edge(geometry, cells) >= rings
        # The search leaves the rim out: the nearest vertex found may not be that.
        inside &= np.maximum(np.abs(foot[:, 0] - cells.rows), np.abs(foot[:, 1] - cells.columns)) <= 0.5 + 1e-9
        standing.state[bodies[~inside]] = FIXED
        standing.until[bodies[~inside]] = -np.inf
        with self._stopwatch.stage("collect"):
            sizes = sizes_together(geometry, cells, np.where(inside, rings, 0))
            for size in np.unique(sizes[inside]).tolist():
                of_size = sizes == size
                self._decide(heightmap, size, moving.of(of_size), way.of(of_size), time, dt, lively=lively)
        looked.version[bodies], looked.window[bodies] = heightmap.version, rings

    def _decide(
        self, heightmap: HeightMap, size: int, moving: Moving, way: Way, time: float, dt: float, *, lively: bool
    ) -> None:
        """Decides for bodies with windows of ``size`` rings."""
        bodies, standing, looked = moving.bodies, self._standing, self._looked
        view, way = self._view(heightmap, size, moving, way, time, dt)
        before = standing.state[bodies]
        choice = choose(
            view.window, view.balls, looked.lean[bodies], self.config,
            before, standing.rings[bodies], standing.stride[bodies], standing.spare[bodies],
        )  # fmt: skip
        if view.ground.velocities is None and not view.ground.holes:
            way = self._roam(view, choice, moving, way, before)
        known = self._note(choice, moving, view.balls.centres, heightmap.geometry.yaw)
        self._note_ahead(heightmap, choice, bodies, view, time, dt)
        looked.where[bodies], looked.since[bodies] = moving.positions_w, time
        # Where the ground's normal is not known, sliding may be an approach.
        looked.drop[bodies], looked.slide[bodies] = (
            way.drop,
            np.where(known, way.slide, np.minimum(way.slide, way.drop)),
        )
        if view.ground.velocities is None:
            hurried = np.asarray(way.slide < HURRY * way.along)
        else:
            hurried = np.asarray(view.ground.velocities.any(axis=1) & lively)
        if hurried.any() and mostly_fields(standing.state) and self.config.kind == "auto":
            crowd = mostly_unlooked(standing.state)
            vain = in_vain(choice, before, view.balls.centres, moving.radii, way.across / dt, crowd=crowd)
            vain &= (hurried | crowd) & reaches_few(moving.radii + way.along, heightmap.geometry.resolution)
            self._leave_alone(moving, vain, time)

    def _view(
        self, heightmap: HeightMap, size: int, moving: Moving, way: Way, time: float, dt: float
    ) -> tuple[View, Way]:
        """Windows of ``size`` rings, and how far bodies may move in them where the ground's velocity changes.

        Then the horizon is shorter: in small windows, as room for it would soon mean a larger patch, and in all if it
        is `LONG`, as curved ground would not pass as flat.
        """
        bodies, resolution, template = moving.bodies, heightmap.geometry.resolution, patch_template(size)
        cells = Cells(self._standing.rows[bodies], self._standing.columns[bodies])
        ground = collect_inside(heightmap, template, cells, np.ones_like(bodies), time, self.config.collect)
        rise = np.zeros(len(bodies))
        if ground.velocities is not None:
            rise = np.nan_to_num(ground.velocities[:, template.centre])
        changing = self._looked.changing(bodies, rise, time, dt)
        horizon = np.full(len(bodies), HORIZON)
        if size <= SMALL_WINDOW or HORIZON * dt > LONG:
            horizon[~(0.5 * (HORIZON * dt) ** 2 * changing <= SLACK)] = SHORT_HORIZON
        ahead = horizon * dt
        centres = np.empty((len(bodies), 3))
        centres[:, 0] = (moving.grid[:, 1] - cells.columns) * resolution
        centres[:, 1] = (moving.grid[:, 0] - cells.rows) * resolution
        centres[:, 2] = moving.positions_w[:, 2]
        swerve = 0.5 * ahead * ahead * np.nan_to_num(changing)  # from where the ground's velocity leads
        way = way._replace(drop=way.drop + swerve)
        balls = Balls(centres=centres, radii=moving.radii + way.drop + FALL * dt * dt, lateral=way.slide)
        return View(ground, window_of(heightmap.geometry, size, ground, ahead), balls, rise, ahead), way

    def _roam(self, view: View, choice: Choice, moving: Moving, way: Way, before: IntArray) -> Way:
        """How far bodies may move on ground at rest, given what was chosen for them, which may change."""
        window, balls, tolerance = view.window, view.balls, self.config.plane_tolerance
        room, deviation = room_on_planes(window, choice, balls, balls.centres, tolerance)
        slide = np.maximum(way.slide, room)
        soon = np.where(before == FIELD, 1.5, 1.0) * HORIZON * way.along
        hurried = (slide < soon) & (choice.deviation > CURVED * tolerance)
        roam = roaming_room(choice, moving.radii, balls.centres, way.slide, window, hurried)
        drop = np.where(roam > 0.0, np.maximum(way.drop, NEARER * moving.radii), way.drop)
        planar = (room > 0.0) & (choice.state != FIELD)
        choice.deviation[planar] = np.maximum(choice.deviation, deviation)[planar]
        return way._replace(drop=drop, slide=np.where(roam > 0.0, roam, slide))

    def _note(self, choice: Choice, moving: Moving, centres: FloatArray, yaw: float) -> BoolArray:
        """Notes what was chosen for bodies at ``centres`` (n, 3) [m] of their windows, and how the ground runs; says
        for which bodies that is known (n,)."""
        bodies, standing, looked, planes = moving.bodies, self._standing, self._looked, choice.planes_at(0)
        standing.state[bodies] = choice.state
        standing.rings[bodies], standing.stride[bodies] = choice.rings, choice.stride
        standing.spare[bodies] = choice.spare
        standing.deviation[bodies], standing.facet[bodies] = choice.deviation, choice.facets
        standing.plane[bodies] = np.stack(planes, axis=1)
        offsets = foot_offset(planes, centres)
        near = np.asarray(np.einsum("ij,ij->i", offsets, offsets) < (2.0 * moving.radii) ** 2)  # not where a hole is
        known = near[:, None]
        looked.normal[bodies] = np.where(known, turned(planes.normals(), yaw), (0.0, 0.0, 1.0))
        # On curved ground the foot decides over the plane and the plane over the foot: half a step each time settles.
        lean, half = looked.lean[bodies], np.where(choice.state == FACET, 1.0, 0.5)[:, None]
        looked.lean[bodies] = np.where(known, lean + half * (offsets - lean), 0.0)
        return near

    def _note_ahead(
        self, heightmap: HeightMap, choice: Choice, bodies: IntArray, view: View, time: float, dt: float
    ) -> None:
        """Notes how the ground under bodies goes on, and until when that holds."""
        standing, velocities = self._standing, view.ground.velocities
        standing.rate[bodies], self._looked.rise[bodies] = 0.0, view.rise
        standing.until[bodies] = np.inf
        if velocities is not None:
            now, later = choice.planes_at(0), choice.planes_at(1)
            standing.rate[bodies] = (np.stack(later, axis=1) - np.stack(now, axis=1)) / view.ahead[:, None]
            until = time + view.ahead - 0.5 * dt
            standing.until[bodies] = np.where(velocities.any(axis=1), until, np.inf)
        standing.read_at[bodies], standing.read_from[bodies] = time, heightmap.version
