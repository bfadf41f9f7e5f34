"""The main mesh as a height map that deforms in place."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.checked_heights import (
    checked,
    checked_friction,
    checked_rectangles,
    checked_variance,
    dense,
    deviation_of,
    require_region,
)
from smartmesh_ros.terrain.core_grid import core_grid_of, tell_friction, update_core_grid
from smartmesh_ros.terrain.corrections import Corrections
from smartmesh_ros.terrain.fusion import FusedMap
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.grid_track import STILL, RigidMotion, at_rest, follow
from smartmesh_ros.terrain.memory import untouched_zeros
from smartmesh_ros.terrain.motion import BLOCK, CLOCK, CLOCK_TIMES, INSTANT, KEPT, MotionConfig
from smartmesh_ros.terrain.revisions import next_revision

# Distance outside the map at which a point still counts as on the edge [samples].
EDGE = 1e-6

_NO_VELOCITIES = np.empty(0, np.float32)


class Samples(NamedTuple):
    """Ground at a set of samples: heights [m] (NaN = no ground) and vertical velocities [m/s], same shape."""

    heights: FloatArray
    velocities: FloatArray


def ground_heights(readers: list[Any], xy_w: ArrayLike, time: float) -> Samples:
    """Return the highest ground of maps and meshes, by their core's readers, under points (N, 2) [m] at ``time`` [s],
    shapes (N,); NaN = no ground."""
    points = np.atleast_2d(np.ascontiguousarray(xy_w, np.float64))
    samples = Samples(np.empty(len(points)), np.empty(len(points)))
    CORE.ground_heights(readers, points, time, *samples)
    return samples


class HeightMap:
    """Heights on a uniform grid, with holes, and their motion.

    ``heights``: (rows, columns) array [m], copied to float32; NaN or masked = no ground. ``resolution``, ``origin`` and
    ``yaw`` place the grid (see `GridGeometry`; an origin of two numbers lies at z = 0); alternatively pass a
    ``geometry``. ``time`` [s]: instant of the heights, on the clock of `Ground` or `World`. ``velocities`` [m/s], same
    shape: vertical velocity of the ground; by default the difference quotient of successive heights. ``variance``
    [m^2]: of the heights, one number or one for each; by default that of ``motion.noise``. ``friction``: coefficient of
    the ground, by which that of a body is multiplied; one number or one for each sample (NaN = 1). By default it is 1,
    or that of the map that this one replaces (see `Terrain.put`).

    If changes are corrections (see `MotionConfig`), the ground has no velocity, heights with a variance are fused over
    time, and the shown heights approach the fused ones as `show` advances.

    The map also stores the last three velocities of each sample, in memory that is allocated when written, and the
    update times of each block of 64 x 64 samples. ``revision`` changes with every update.
    """

    def __init__(
        self,
        heights: ArrayLike,
        *,
        resolution: float = 1.0,
        origin: tuple[float, ...] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        geometry: GridGeometry | None = None,
        time: float = 0.0,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
        friction: float | ArrayLike | None = None,
        motion: MotionConfig | None = None,
    ) -> None:
        if geometry is None:
            shape = np.shape(heights)
            if len(shape) != 2:
                raise InputError("length", f"heights have shape {shape}; it must be (rows, columns)")
            x, y, z = (*origin, 0.0)[:3]
            geometry = GridGeometry(
                rows=shape[0],
                columns=shape[1],
                resolution=resolution,
                origin=(float(x), float(y), float(z)),
                yaw=yaw,
            )
        self.geometry = geometry
        self._motion = motion or MotionConfig()
        self._core: Any = None
        shape = (geometry.rows, geometry.columns)
        new, speeds = checked(heights, velocities, shape, "the map")
        self._heights = np.array(new, order="C")
        self._velocities = untouched_zeros((KEPT, *shape))
        self._clocks = np.zeros((-(-shape[0] // BLOCK), -(-shape[1] // BLOCK)), CLOCK)
        self._clocks["time"] = -np.inf
        self._corrections = Corrections(shape)
        self._deviation: float | None = None  # standard deviation by the last update's variances [m], None = not given
        self.version = 0  # number of updates
        self._friction = None if friction is None else checked_friction(friction, shape)
        self._take(0, 0, new, speeds, time, checked_variance(variance, shape))
        self.track = at_rest(geometry, self.time)  # pose and rigid motion of the grid

    @property
    def heights(self) -> NDArray[np.float32]:
        """The last map's heights [m], (rows, columns), without the origin's z; read-only."""
        view = self._heights.view()
        view.setflags(write=False)
        return view

    @property
    def friction(self) -> float | NDArray[np.float32]:
        """Coefficient of the ground, by which that of a body is multiplied: one number, or (rows, columns), NaN = 1.

        Assign another to replace it; raises `InputError` and then changes nothing.
        """
        return 1.0 if self._friction is None else self._friction

    @friction.setter
    def friction(self, friction: float | ArrayLike) -> None:
        self._friction = checked_friction(friction, (self.geometry.rows, self.geometry.columns))
        self._clocks["updates"] += 1  # what rests on the ground looks at it again
        self.revision = next_revision()
        if self._core is not None:
            tell_friction(self._core, self._friction)

    @property
    def has_friction(self) -> bool:
        """True if coefficients of friction were given."""
        return self._friction is not None

    @property
    def motion(self) -> MotionConfig:
        """Motion of the ground between maps."""
        return self._motion

    @motion.setter
    def motion(self, motion: MotionConfig) -> None:
        self._motion = motion
        self._tell_core()

    @property
    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.void], NDArray[np.float32]]:
        """The arrays that change in place: heights (rows, columns) [m], NaN = hole;
        velocities (KEPT, rows, columns) [m/s], a ring buffer whose newest index is in the clock of each block; clocks,
        records of ``CLOCK``, one for each block; offsets (rows, columns) [m], old minus new heights of corrections."""
        return self._heights, self._velocities, self._clocks, self._corrections.offsets

    @property
    def core_reader(self) -> Any:
        """The reader of this map in the C++ core."""
        if self._core is None:
            self._core = core_grid_of(self)
        return self._core

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.geometry.size

    @property
    def description(self) -> str:
        """Size and resolution as text."""
        return f"{self.geometry.rows} x {self.geometry.columns} at {self.geometry.resolution:g} m"

    @property
    def lifetime(self) -> float:
        """Expected time between updates of moving ground [s]; 0 = no update expected."""
        return float(self.core_reader.lifetime())

    @property
    def delay(self) -> float:
        """Expected age of an update on arrival [s]; extrapolation continues until the update is due."""
        return float(self._clocks["delay"][0, 0])

    @delay.setter
    def delay(self, delay: float) -> None:
        self._clocks["delay"] = delay

    @property
    def noise(self) -> float:
        """Standard deviation of the heights [m] for the estimation of velocities; 0 = exact heights."""
        return self.motion.noise if self._deviation is None else self._deviation

    @property
    def time(self) -> float:
        """Time of the newest sample [s]."""
        return float(self._clocks["time"].max())

    @property
    def correcting(self) -> bool:
        """True while corrections are being blended in."""
        return self._corrections.blending

    @property
    def shown(self) -> float:
        """Instant up to which corrections are blended in [s]; infinity before the first."""
        return self._corrections.shown

    @property
    def fused(self) -> FusedMap | None:
        """The estimate of the heights, None if they are not fused."""
        return self._corrections.fused

    def show(self, time: float) -> None:
        """Blend corrections in up to ``time`` [s]; earlier times than before have no effect."""
        self._corrections.show(time)
        if self._core is not None:
            self._core.show(self.shown)

    def correct_from(self, before: "HeightMap", cells: tuple[int, int] | None) -> None:
        """Treat this map as a correction of the map ``before`` it, which it replaces, where both have ground.

        ``cells``: (rows, columns) by which the map was scrolled, None = the maps lie on different grids.
        """
        self._corrections.show_as(before._corrections)
        if cells is None:
            rows, columns = np.mgrid[: self.geometry.rows, : self.geometry.columns]
            shown = before.at(self.geometry.to_world(rows, columns).reshape(-1, 2), before.time).heights
        else:
            shown = np.empty(self._heights.shape)
            CORE.grid_window(before.core_reader, *cells, before.time, shown)
            self._corrections.fuse_across(before._corrections, cells, max(self.time - before.time, 0.0))
        known = self._heights.copy() if self.fused is None else self.fused.heights
        self._heights[...] = shown.reshape(known.shape) - self.geometry.origin[2]
        self._correct(0, 0, known, self.time)
        self._tell_core()

    def replace(
        self,
        heights: ArrayLike,
        *,
        time: float,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
        friction: float | ArrayLike | None = None,
    ) -> None:
        """Replace all heights (rows, columns) [m], and the friction unless it is None; raises `InputError` and then
        changes nothing."""
        shape = (self.geometry.rows, self.geometry.columns)
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the map")
        if friction is not None:
            self.friction = friction
        self._take(0, 0, new, speeds, time, certainty)
        if not self.motion.corrects:
            self.follow(self, time)
        self._tell_core()

    def update_region(
        self,
        row: int,
        column: int,
        heights: ArrayLike,
        *,
        time: float,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
    ) -> None:
        """Replace the heights (h, w) [m] of the rectangle whose first sample is (``row``, ``column``).

        The cost depends on the size of the rectangle, not of the map. Other samples of the blocks that the rectangle
        touches count as at rest. Raises `InputError` and then changes nothing.
        """
        shape = np.shape(heights)
        require_region(row, column, shape, (self.geometry.rows, self.geometry.columns))
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the region")
        self._take(row, column, new, speeds, time, certainty)
        self._tell_core()

    def update_rectangles(
        self, rectangles: ArrayLike, heights: ArrayLike, velocities: ArrayLike, *, time: float
    ) -> None:
        """Replace the heights [m] and velocities [m/s] of several ``rectangles`` (n, 4), as `update_region` for each: a
        rectangle is its first row and column, last row and column. ``heights``, ``velocities`` (N,): of the samples of
        one rectangle after the other, each row by row. Raises `InputError` and then changes nothing."""
        places, count = checked_rectangles(rectangles, (self.geometry.rows, self.geometry.columns))
        if count == 0:
            return
        new, speeds = checked(heights, velocities, (count,), "the rectangles")
        assert speeds is not None
        self.take_rectangles(places, dense(new), dense(speeds), time)

    def take_rectangles(
        self, places: IntArray, new: NDArray[np.float32], speeds: NDArray[np.float32], time: float
    ) -> None:
        """Do as `update_rectangles` with arrays that the core made: they have its types, and infinities are not looked
        for."""
        if self.motion.corrects:
            start = 0
            for top, left, bottom, right in places.tolist():
                shape = bottom - top + 1, right - left + 1
                end = start + shape[0] * shape[1]
                self._take(top, left, new[start:end].reshape(shape), None, time, None)
                start = end
        elif len(places):
            self._write(places, new, speeds, time)
            self.version += len(places)
            self.revision = next_revision()
            self._deviation = None
        self._tell_core()

    def moving(self, time: float) -> bool:
        """Return True if any sample may move at ``time`` [s]."""
        if self.motion.corrects:
            return self.correcting
        return bool(self.core_reader.moves(time))

    def slide(self, velocity_w: tuple[float, float], interval: float, spin: float = 0.0) -> None:
        """Set the rigid motion of the map: horizontal velocity of its sample (0, 0) [m/s] and ``spin`` about z [rad/s].

        ``interval`` [s]: expected time between maps.
        """
        motion = RigidMotion(*velocity_w, spin)
        self.track = at_rest(self.geometry, self.time)
        if motion != STILL:
            self.track = self.track._replace(motion=motion, interval=interval)
        self._tell_core()

    def follow(self, before: "HeightMap", time: float) -> None:
        """Estimate the rigid motion of this map of ``time`` [s] from its pose and the track of the map ``before``."""
        motion = self.motion
        self.track, _ = follow(before.track, self.geometry, time, motion.max_interval, motion.max_velocity)
        self._tell_core()

    @property
    def has_velocities(self) -> bool:
        """True if vertical velocities were given or estimated."""
        return bool(self._clocks["known"].any())

    def set_velocities(self, velocities: NDArray[np.float32]) -> None:
        """Set the vertical velocities (rows, columns) [m/s] of the newest heights."""
        self._store(0, 0, self._heights.copy(), velocities, self.time)
        self._tell_core()

    def go_on_from(self, before: "HeightMap") -> None:
        """Estimate vertical velocities as if these heights had replaced those of ``before``, a map on the same grid but
        for the height of its origin."""
        new, time = self._heights, self.time
        self._core = None  # it reads the arrays that are replaced here
        self._heights = before._heights + np.float32(before.geometry.origin[2] - self.geometry.origin[2])
        self._clocks = before._clocks.copy()
        if before.has_velocities:
            self._velocities = before._velocities.copy()
        self._store(0, 0, new, None, time)

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to all update times, after their clock was reset or lost time."""
        for name in CLOCK_TIMES:
            self._clocks[name] += by
        self.track = self.track.shifted(by)
        self._corrections.shift_time(by)
        self._tell_core()

    def placed_at(self, time: float) -> GridGeometry:
        """Return the grid at its pose at ``time`` [s]."""
        if not self.track.interval:
            return self.geometry
        x, y, cos, sin, *_ = CORE.grid_pose(self.core_reader, time)
        return dataclasses.replace(self.geometry, origin=(x, y, self.geometry.origin[2]), yaw=math.atan2(sin, cos))

    def sample(self, indices: IntArray, time: float, ahead: float = INSTANT) -> Samples:
        """Return the ground at ``time`` [s] at samples given by ``indices`` (...) into the row-major map; shapes (...).

        Heights include the origin's z. Velocities are means over the time ``ahead`` [s].
        """
        flat = np.ascontiguousarray(indices, np.int64).reshape(-1)
        heights, velocities = np.empty(len(flat)), np.empty(len(flat))
        CORE.sample_grid(self.core_reader, flat, time, ahead, heights, velocities)
        return Samples(heights.reshape(indices.shape), velocities.reshape(indices.shape))

    def beyond(self, xy_w: FloatArray) -> FloatArray:
        """Return the distance of points (N, 2+) beyond the map's edge (N,) [m], zero or less inside.

        Points on the edge count as inside, despite rounding.
        """
        grid = self.geometry.to_grid(xy_w)
        over: FloatArray = np.maximum(-grid, grid - self.geometry.last).max(axis=1)
        return (over - EDGE) * self.geometry.resolution

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Return the ground under points (N, 2) [m] at ``time`` [s], shapes (N,); NaN outside the map and in holes."""
        return ground_heights([self.core_reader], xy_w, time)

    def deviations_at(self, xy_w: FloatArray) -> FloatArray:
        """Return the standard deviation of the fused heights of the samples nearest to points (N, 2) [m]; zero outside
        the map, where nothing was measured, and without fusion (N,) [m]."""
        return self._corrections.deviations_at(np.rint(self.geometry.to_grid(xy_w)).astype(np.int64))

    def _tell_core(self) -> None:
        """Tell the core what has changed beside the arrays."""
        if self._core is not None:
            update_core_grid(self._core, self)

    def _take(
        self,
        row: int,
        column: int,
        new: NDArray[np.float32],
        speeds: NDArray[np.float32] | None,
        time: float,
        variance: float | NDArray[np.float32] | None,
    ) -> None:
        """Store checked heights and their time."""
        self.version += 1
        self.revision = next_revision()
        if self.motion.corrects:
            certainty = self.motion.noise**2 if variance is None else variance
            known = self._corrections.fuse((row, column), new, certainty, time, self._clocks)
            self._correct(row, column, known, time)
            return
        self._deviation = None if variance is None else deviation_of(variance)
        self._store(row, column, new, speeds, time)

    def _store(
        self, row: int, column: int, new: NDArray[np.float32], speeds: NDArray[np.float32] | None, time: float
    ) -> None:
        """Store heights of a rectangle that moves, and their velocities if they were given."""
        high, wide = new.shape
        place = np.array([[row, column, row + high - 1, column + wide - 1]], np.int64)
        self._write(place, dense(new), _NO_VELOCITIES if speeds is None else dense(speeds), time)

    def _write(self, places: IntArray, new: NDArray[np.float32], speeds: NDArray[np.float32], time: float) -> None:
        """Write heights and velocities of rectangles (n, 4), as in `update_rectangles`."""
        CORE.take_rectangles(
            self._heights, self._velocities, as_bytes(self._clocks), places, new.reshape(-1), speeds.reshape(-1),
            time, (self.motion.min_interval, self.motion.max_interval),
        )  # fmt: skip

    def _correct(self, row: int, column: int, known: NDArray[np.float32], time: float) -> None:
        """Store the new estimate of a rectangle of static ground."""
        self._corrections.take(self._heights, self._clocks, (row, column), known, time, self.motion.settle)
