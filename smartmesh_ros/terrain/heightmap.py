"""The main mesh as a height map that deforms in place."""

import dataclasses
import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import as_float, require
from smartmesh_ros.terrain.checked_heights import (
    LATEST,
    as_points,
    checked_ahead,
    checked_numbers,
    checked_time,
    unmasked,
)
from smartmesh_ros.terrain.corrections import fuse_across
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray, overlap
from smartmesh_ros.terrain.grid_track import STILL, RigidMotion, at_rest
from smartmesh_ros.terrain.motion import BLOCK, INSTANT
from smartmesh_ros.terrain.moving_heights import MovingHeights
from smartmesh_ros.terrain.prints import Prints


class Samples(NamedTuple):
    """Ground at a set of samples: heights [m] (NaN = no ground) and vertical velocities [m/s], same shape."""

    heights: FloatArray
    velocities: FloatArray


def ground_heights(tiles: Any, xy_w: ArrayLike, time: float) -> Samples:
    """Return the highest ground of tiles of the core under points (N, 2) [m] at ``time`` [s], shapes (N,); NaN = no
    ground."""
    array, time = unmasked(xy_w, "points"), checked_time(time)
    points = np.ascontiguousarray(as_points(np.atleast_2d(array), (2,)), np.float64)
    return Samples(*CORE.ground_heights(tiles, points, time))


class HeightMap(MovingHeights):
    """Heights on a uniform grid, with holes, and their motion.

    ``heights``: (rows, columns) array [m], copied to float32; NaN or masked = no ground. ``resolution``, ``origin`` and
    ``yaw`` place the grid (see `GridGeometry`; an origin of two numbers lies at z = 0); alternatively pass a
    ``geometry``. ``time`` [s]: instant of the heights, on the clock of `Ground` or `World`. ``velocities`` [m/s], same
    shape: vertical velocity of the ground; by default the difference quotient of successive heights. ``variance``
    [m^2]: of the heights, one number or one for each; by default that of ``motion.noise``. ``material``: friction,
    stiffness, damping, restitution, rolling resistance and soil of the ground, see `Material`; ``friction`` and
    ``soil`` may be given by themselves. Layers that are not given are the usual ones, or those of the map that this one
    replaces (see `Terrain.put`).

    If changes are corrections (see `MotionConfig`), the ground has no velocity, heights with a variance are fused over
    time, and the shown heights approach the fused ones as `show` advances.

    The map also stores the last three velocities of each sample, in memory that is allocated when written, and the
    update times of each block of 64 x 64 samples. ``revision`` changes with every update.
    """

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.geometry.size

    @property
    def description(self) -> str:
        """Size and resolution as text."""
        return f"{self.geometry.rows} x {self.geometry.columns} at {self.geometry.resolution:g} m"

    def correct_from(self, before: "HeightMap", cells: tuple[int, int] | None) -> None:
        """Treat this map as a correction of the map ``before`` it, which it replaces, where both have ground.

        ``cells``: (rows, columns) by which the map was scrolled, None = the maps lie on different grids.
        """
        self.core_reader.show(before.core_reader.shown if before.motion.corrects else math.inf)
        if cells is None:
            rows, columns = np.mgrid[: self.geometry.rows, : self.geometry.columns]
            shown = before.at(self.geometry.to_world(rows, columns).reshape(-1, 2), before.time).heights
        else:
            shown = np.empty(self._heights.shape)
            CORE.grid_window(before.core_reader, *cells, before.time, shown)
            fuse_across(self.core_reader, before.core_reader, cells, max(self.time - before.time, 0.0))
        fused = self.core_reader.fused
        known = self._heights.copy() if fused is None else fused[0]
        self._heights[...] = shown.reshape(known.shape) - self.geometry.origin[2]
        self._correct(0, 0, known, self.time)

    def moving(self, time: float) -> bool:
        """Return True if any sample may move at ``time`` [s]."""
        if self.motion.corrects:
            return bool(self.core_reader.shown < self.core_reader.settled)
        return bool(self.core_reader.moves(checked_time(time)))

    def slide(self, velocity_w: tuple[float, float], interval: float, spin: float = 0.0) -> None:
        """Set the rigid motion of the map: horizontal velocity of its sample (0, 0) [m/s] and ``spin`` about z [rad/s].

        ``interval`` [s]: expected time between maps. Raises `InputError`.
        """
        speeds = [*map(as_float, velocity_w)] if isinstance(velocity_w, Iterable) else []
        good = len(speeds) == 2 and all(map(math.isfinite, speeds))
        require(good, "motion", "the velocity of a map", velocity_w, "two finite numbers [m/s]")
        require(math.isfinite(as_float(spin)), "motion", "the spin of a map", spin, "finite [rad/s]")
        good = 0.0 < as_float(interval) <= LATEST
        require(good, "motion", "the interval of maps", interval, f"above zero, up to {LATEST:g} s")
        motion = RigidMotion(speeds[0], speeds[1], float(spin))
        self.track = at_rest(self.geometry, self.time)
        if motion != STILL:
            self.track = self.track._replace(motion=motion, intervals=(float(interval),))

    def press(self, places: IntArray, heights: NDArray[np.float32]) -> None:
        """Write the ``heights`` (n,) [m] to which bodies pressed the samples at ``places`` (n, 2), rows and columns.
        Unlike an update they say nothing about how the ground moves, and they stay while others send the heights again
        that were there before."""
        if self.prints is None:
            self.prints = Prints(self._heights)
        self.prints.press(places, heights)
        self._clocks["updates"][tuple(places.T // BLOCK)] += 1
        self.version += len(places)
        self._set_deviation(None)
        self.core_reader.note_change()

    def go_on_from(self, before: "HeightMap", cells: tuple[int, int]) -> None:
        """Estimate vertical velocities as if these heights had replaced those of ``before``, a map on the same grid but
        for the height of its origin and ``cells`` (rows, columns) back. New ground has no velocity."""
        new, time = self._heights.copy(), self.time
        here, there = overlap(cells, new.shape)
        self._heights[...] = np.nan
        rise = np.float32(before.geometry.origin[2] - self.geometry.origin[2])
        np.add(before._heights[there], rise, out=self._heights[here])
        first = before._clocks.flat[0]
        if cells == (0, 0):
            self._clocks[...] = before._clocks
        elif (before._clocks == first).all():
            self._clocks[...] = first
        else:  # its blocks were updated at different times, and are not those of this map
            self._clocks["time"] = before.track.time
        if before.has_velocities:
            self._velocities[:, *here] = before._velocities[:, *there]
        if self.motion.blends:
            self._offsets[here] = before._offsets[there]
            self._rates[here] = before._rates[there]
        self.core_reader.show(before.core_reader.shown)
        self._store(0, 0, new, None, time)

    def placed_at(self, time: float) -> GridGeometry:
        """Return the grid at its pose at ``time`` [s]."""
        if not self.track.interval:
            return self.geometry
        x, y, cos, sin, *_ = CORE.grid_pose(self.core_reader, time)
        return dataclasses.replace(self.geometry, origin=(x, y, self.geometry.origin[2]), yaw=math.atan2(sin, cos))

    def sample(self, indices: IntArray, time: float, ahead: float = INSTANT) -> Samples:
        """Return the ground at ``time`` [s] at samples given by ``indices`` (...) into the row-major map; shapes (...).

        Heights include the origin's z. Velocities are means over the time ``ahead`` [s]. Raises `InputError`.
        """
        numbers, time, ahead = checked_numbers(indices), checked_time(time), checked_ahead(ahead)
        heights, velocities = CORE.sample_grid(self.core_reader, numbers.reshape(-1), time, ahead)
        return Samples(heights.reshape(numbers.shape), velocities.reshape(numbers.shape))

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Return the ground under points (N, 2) [m] at ``time`` [s], shapes (N,); NaN outside the map and in holes."""
        return ground_heights(CORE.Tiles([self.core_reader]), xy_w, time)
