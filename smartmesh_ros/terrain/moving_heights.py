"""Heights on a uniform grid that change in place, and their motion."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.checked_heights import (
    checked,
    checked_friction,
    checked_variance,
    dense,
    deviation_of,
    require_region,
)
from smartmesh_ros.terrain.corrections import Corrections, untouched_zeros
from smartmesh_ros.terrain.grid import GridGeometry, IntArray
from smartmesh_ros.terrain.grid_track import at_rest, follow
from smartmesh_ros.terrain.motion import BLOCK, CLOCK, KEPT, MotionConfig, MovingGround, next_revision

Heights = NDArray[np.float32]
# Rows and columns of no samples.
NOTHING = np.empty((0, 2), np.int64)


def corners(places: IntArray, others: IntArray) -> IntArray:
    """Return the first and the last row and column of all places (n, 2), as (2, 2)."""
    both = np.vstack((places, others))
    return np.stack((both.min(axis=0), both.max(axis=0)))


class Prints:
    """Prints: what bodies pressed into the heights (rows, columns) [m] of a map, over those that its sender knows.
    ``corners`` (2, 2): of all prints so far."""

    def __init__(self, heights: Heights) -> None:
        self._heights = heights
        self._given = np.full_like(heights, np.nan)  # what its sender sent for pressed samples
        self.corners = NOTHING

    def press(self, places: IntArray, heights: Heights) -> None:
        """Write ``heights`` (n,) of the samples at ``places`` (n, 2), rows and columns."""
        at = tuple(places.T)
        given = self._given[at]
        self._given[at] = np.where(np.isnan(given), self._heights[at], given)
        self._heights[at] = heights
        self.corners = corners(places, self.corners)

    @contextmanager
    def lifted(self) -> Iterator[None]:
        """Take the prints out of the map for an update. Afterwards they are where its sender sent the same heights
        again, and are forgotten elsewhere."""
        box = tuple(slice(first, last + 1) for first, last in self.corners.T.tolist())
        heights, given = self._heights[box], self._given[box]
        pressed = ~np.isnan(given)
        prints, before = heights[pressed], given[pressed]
        heights[pressed] = before
        yield
        same = heights[pressed] == before
        heights[pressed] = np.where(same, prints, heights[pressed])
        given[pressed] = np.where(same, before, np.nan)


_NO_VELOCITIES = np.empty(0, np.float32)


class MovingHeights(MovingGround):
    """What a `HeightMap` stores: heights, their last velocities and update times, corrections, friction, and the motion
    of the grid. All change in place; the core reads the same arrays."""

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
            place = float(x), float(y), float(z)
            geometry = GridGeometry(rows=shape[0], columns=shape[1], resolution=resolution, origin=place, yaw=yaw)
        self.geometry = geometry
        self._motion = motion or MotionConfig()
        shape = (geometry.rows, geometry.columns)
        new, speeds = checked(heights, velocities, shape, "the map")
        self._heights = np.array(new, order="C")
        self._velocities = untouched_zeros((KEPT, *shape))
        self.prints: Prints | None = None  # made by the first `press` of a `HeightMap`
        self._clocks = np.zeros((-(-shape[0] // BLOCK), -(-shape[1] // BLOCK)), CLOCK)
        self._clocks["time"] = -np.inf
        self.corrections = Corrections(shape)
        # The reader of this map in the C++ core.
        self.core_reader: Any = CORE.Grid(
            self._heights, self._velocities, self.corrections.offsets, as_bytes(self._clocks)
        )
        self._deviation: float | None = None  # standard deviation by the last update's variances [m], None = not given
        self.version = 0  # number of updates
        self._friction = None if friction is None else checked_friction(friction, shape)
        self._take(0, 0, new, speeds, time, checked_variance(variance, shape))
        self.track = at_rest(geometry, self.time)  # pose and rigid motion of the grid
        self._tell_core()
        self._tell_friction()

    @property
    def heights(self) -> NDArray[np.float32]:
        """The last map's heights [m], (rows, columns), without the origin's z; read-only."""
        view = self._heights.view()
        view.setflags(write=False)
        return view

    @property
    def friction(self) -> float | NDArray[np.float32]:
        """Coefficient of the ground, by which that of a body is multiplied: one number, or (rows, columns), NaN = 1;
        read-only.

        Assign another to replace it; raises `InputError` and then changes nothing.
        """
        return 1.0 if self._friction is None else self._friction

    @friction.setter
    def friction(self, friction: float | ArrayLike) -> None:
        self._friction = checked_friction(friction, (self.geometry.rows, self.geometry.columns))
        self._clocks["updates"] += 1  # what rests on the ground looks at it again
        self.revision = next_revision()
        self._tell_friction()

    @property
    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.void], NDArray[np.float32]]:
        """The arrays that change in place: heights (rows, columns) [m], NaN = hole;
        velocities (KEPT, rows, columns) [m/s], a ring buffer whose newest index is in the clock of each block; clocks,
        records of ``CLOCK``, one for each block; offsets (rows, columns) [m], old minus new heights of corrections."""
        return self._heights, self._velocities, self._clocks, self.corrections.offsets

    @property
    def noise(self) -> float:
        """Standard deviation of the heights [m] for the estimation of velocities; 0 = exact heights."""
        return self.motion.noise if self._deviation is None else self._deviation

    def show(self, time: float) -> None:
        """Blend corrections in up to ``time`` [s]; earlier times than before have no effect."""
        self.corrections.show(time)
        self.core_reader.show(self.corrections.shown)

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

    def take_rectangles(
        self, places: IntArray, new: NDArray[np.float32], speeds: NDArray[np.float32], time: float
    ) -> None:
        """Replace heights [m] and velocities [m/s] of several rectangles, as `update_region` for each, by arrays of the
        core, which are not checked. ``places`` (n, 4): first row and column, last row and column; ``new``, ``speeds``
        (N,): of the samples of one rectangle after the other, each row by row."""
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

    def follow(self, before: MovingHeights, time: float) -> None:
        """Estimate the rigid motion of this map of ``time`` [s] from its pose and the track of the map ``before``."""
        motion = self.motion
        self.track, _ = follow(before.track, self.geometry, time, motion.max_interval, motion.max_velocity)
        self._tell_core()

    @property
    def has_velocities(self) -> bool:
        """True if vertical velocities were given or estimated."""
        return bool(self._clocks["known"].any())

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to all update times, after their clock was reset or lost time."""
        super().shift_time(by)
        self.track = self.track.shifted(by)
        self.corrections.shift_time(by)
        self._tell_core()

    def _tell_core(self) -> None:
        """Tell the core the pose, the motion and the settings of the map, which are not in its arrays."""
        geometry, track, motion, core = self.geometry, self.track, self.motion, self.core_reader
        core.place(*geometry.origin, geometry.yaw, geometry.resolution)
        core.move(track.time, track.interval, *track.motion)
        fused = self.corrections.fused
        core.set_variances(None if fused is None else fused.variances)
        core.set_motion(motion.code, motion.max_velocity, motion.settle, self.noise, self.corrections.shown)

    def _tell_friction(self) -> None:
        samples, uniform = (None, self.friction) if isinstance(self.friction, float) else (self.friction, 1.0)
        self.core_reader.set_friction(samples, uniform)

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
            known = self.corrections.fuse((row, column), new, certainty, time, self._clocks)
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
        """Write heights and velocities of rectangles (n, 4), as in `take_rectangles`."""
        with self.prints.lifted() if self.prints else nullcontext():
            CORE.take_rectangles(
                self._heights, self._velocities, as_bytes(self._clocks), places, new.reshape(-1), speeds.reshape(-1),
                time, (self.motion.min_interval, self.motion.max_interval),
            )  # fmt: skip

    def _correct(self, row: int, column: int, known: NDArray[np.float32], time: float) -> None:
        """Store the new estimate of a rectangle of static ground."""
        self.corrections.take(self._heights, self._clocks, (row, column), known, time, self.motion.settle)
