"""Heights on a uniform grid that change in place, and their motion."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE, as_bytes
from smartmesh_ros.terrain.checked_heights import (
    checked,
    checked_friction,
    checked_next_time,
    checked_soil,
    checked_time,
    checked_variance,
    dense,
    deviation_of,
    require_region,
    unmasked,
)
from smartmesh_ros.terrain.corrections import Corrections, nothing_known, untouched_zeros
from smartmesh_ros.terrain.grid import GridGeometry, geometry_of
from smartmesh_ros.terrain.grid_track import at_rest, follow
from smartmesh_ros.terrain.motion import BLOCK, CLOCK, KEPT, MotionConfig, MovingGround, next_revision
from smartmesh_ros.terrain.prints import Prints
from smartmesh_ros.terrain.state_file import filled


class MovingHeights(MovingGround):
    """What a `HeightMap` stores: heights, their last velocities and update times, corrections, friction, soil, and the
    motion of the grid. All change in place; the core reads the same arrays."""

    def __init__(
        self,
        heights: ArrayLike,
        *,
        resolution: float | None = None,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        geometry: GridGeometry | None = None,
        time: float = 0.0,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
        friction: float | ArrayLike | None = None,
        soil: ArrayLike | None = None,
        motion: MotionConfig | None = None,
    ) -> None:
        if geometry is None:
            heights = unmasked(heights, "heights of the map")
            geometry = geometry_of(heights.shape, resolution, origin, yaw)
        time = checked_time(time)
        self.geometry = geometry
        self._motion = motion or MotionConfig()
        shape = (geometry.rows, geometry.columns)
        new, speeds = checked(heights, velocities, shape, "the map")
        self._heights = np.array(new, order="C")
        self._velocities = untouched_zeros((KEPT, *shape))
        self._rates = untouched_zeros(shape)
        self.prints: Prints | None = None  # made by the first `press` of a `HeightMap`
        self._clocks = np.zeros((-(-shape[0] // BLOCK), -(-shape[1] // BLOCK)), CLOCK)
        self._clocks["time"] = -np.inf
        self.corrections = Corrections(shape)
        # The reader of this map in the C++ core.
        self.core_reader: Any = CORE.Grid(
            self._heights, self._velocities, self.corrections.offsets, self._rates, as_bytes(self._clocks)
        )
        self._deviation: float | None = None  # standard deviation by the last update's variances [m], None = not given
        self.version = 0  # number of updates
        self._friction = None if friction is None else checked_friction(friction, shape)
        self._soil = None if soil is None else checked_soil(soil, shape)
        self.soil_revision = 0  # changes with every assignment of the soil
        self.track = at_rest(geometry, time)  # pose and rigid motion of the grid
        self._tell_core()
        self._take(0, 0, new, speeds, time, checked_variance(variance, shape))
        self._tell_core()
        self._tell_friction()

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the map, or one in another process, is made of: arrays, and what they mean."""
        corrections, prints = self.corrections, self.prints
        return {
            "map": {
                "geometry": self.geometry,
                "motion": self.motion,
                "friction": self._friction,
                "soil": self._soil,
            },
            "heights": self._heights,
            "clocks": self._clocks,
            # Arrays of zeros take no memory, and no bytes.
            "others": tuple(array if array.any() else None for array in self._others),
            "track": self.track,
            "version": self.version,
            "deviation": self._deviation,
            "shown": self.core_reader.shown,
            "corrections": (corrections.shown, corrections.settled),
            "fused": corrections.fused,
            "prints": None if prints is None else (prints.given, prints.corners),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the map of such a state."""
        MovingHeights.__init__(self, state["heights"], **state["map"])
        self._take_clocks(state["clocks"])
        for array, kept in zip(self._others, state["others"], strict=True):
            if kept is not None:
                filled(array, kept)
        self.track, self.version, self._deviation = state["track"], state["version"], state["deviation"]
        self.corrections.shown, self.corrections.settled = state["corrections"]
        if state["fused"] is not None:
            self.corrections.fused = nothing_known(*self._heights.shape)
            for array, kept in zip(self.corrections.fused, state["fused"], strict=True):
                filled(array, kept)
        if state["prints"] is not None:
            self.prints = Prints(self._heights)
            given, self.prints.corners = state["prints"]
            filled(self.prints.given, given)
        self._tell_core()
        self.core_reader.show(state["shown"])

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
    def soil(self) -> NDArray[np.uint8] | None:
        """Which soil each sample is, by its place in the list of a `Soil` (rows, columns); None = the first everywhere;
        read-only.

        Assign others to replace them; raises `InputError` and then changes nothing. `Ground.update` tells its `Soil`.
        """
        if self._soil is None:
            return None
        view = self._soil.view()
        view.setflags(write=False)
        return view

    @soil.setter
    def soil(self, soil: ArrayLike) -> None:
        self._soil = checked_soil(soil, (self.geometry.rows, self.geometry.columns))
        self.soil_revision = self.revision = next_revision()

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """The arrays that change in place: heights (rows, columns) [m], NaN = hole;
        velocities (KEPT, rows, columns) [m/s], a ring buffer whose newest index is in the clock of each block; clocks,
        records of ``CLOCK``, one for each block; offsets (rows, columns) [m], old minus new heights of corrections, or
        deviations of shown ground; rates (rows, columns) [m/s] of these."""
        return self._heights, self._velocities, self._clocks, self.corrections.offsets, self._rates

    @property
    def _others(self) -> tuple[NDArray[np.float32], ...]:
        return self._velocities, self.corrections.offsets, self._rates

    @property
    def noise(self) -> float:
        """Standard deviation of the heights [m] for the estimation of velocities; 0 = exact heights."""
        return self.motion.noise if self._deviation is None else self._deviation

    def show(self, time: float) -> None:
        """Blend corrections in up to ``time`` [s]; earlier times than before have no effect."""
        self.corrections.show(checked_time(time))
        self.core_reader.show(self.corrections.shown)

    def replace(
        self,
        heights: ArrayLike,
        *,
        time: float,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
        friction: float | ArrayLike | None = None,
        soil: ArrayLike | None = None,
    ) -> None:
        """Replace all heights (rows, columns) [m], and the friction and the soil unless they are None; raises
        `InputError` and then changes nothing."""
        shape = (self.geometry.rows, self.geometry.columns)
        time = checked_next_time(time, self.time)
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the map")
        places = None if soil is None else checked_soil(soil, shape)
        if friction is not None:
            self.friction = friction
        if places is not None:
            self.soil = places
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
        time, heights = checked_next_time(time, self.time), unmasked(heights, "heights of the region")
        shape = heights.shape
        require_region(row, column, shape, (self.geometry.rows, self.geometry.columns))
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the region")
        self._take(row, column, new, speeds, time, certainty)
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
        core.set_motion(motion.code, motion.max_velocity, motion.settle, self.noise, motion.smoothing)
        if motion.corrects:
            core.show(self.corrections.shown)

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
        intervals = self.motion.min_interval, self.motion.max_interval
        with self.prints.lifted() if self.prints else nullcontext():
            given = None if speeds is None else dense(speeds)
            CORE.take_rectangle(self.core_reader, (row, column), dense(new), given, time, intervals)

    def _correct(self, row: int, column: int, known: NDArray[np.float32], time: float) -> None:
        """Store the new estimate of a rectangle of static ground."""
        self.corrections.take(self.core_reader, (row, column), known, time, self.motion.settle)
