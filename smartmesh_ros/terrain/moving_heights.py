"""Heights on a uniform grid that change in place, and their motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.checked_heights import (
    checked,
    checked_next_time,
    checked_place,
    checked_time,
    checked_variance,
    dense,
    deviation_of,
    unmasked,
)
from smartmesh_ros.terrain.corrections import fuse_rectangle
from smartmesh_ros.terrain.grid import GridGeometry, geometry_of
from smartmesh_ros.terrain.grid_track import GridTrack, at_rest, follow
from smartmesh_ros.terrain.laid_ground import LaidGround
from smartmesh_ros.terrain.material import Material, together
from smartmesh_ros.terrain.motion import CLOCK, MotionConfig, MovingGround, checked_motion
from smartmesh_ros.terrain.prints import Prints
from smartmesh_ros.terrain.state_file import filled


class MovingHeights(LaidGround, MovingGround):
    """What a `HeightMap` stores: heights, their last velocities and update times, corrections, material, and the motion
    of the grid. The arrays are the core's memory."""

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
        material: Material | None = None,
        motion: MotionConfig | None = None,
    ) -> None:
        if geometry is None:
            heights = unmasked(heights, "heights of the map")
            geometry = geometry_of(heights.shape, resolution, origin, yaw)
        elif not isinstance(geometry, GridGeometry):
            raise InputError("geometry", f"the geometry is {geometry!r}; pass GridGeometry(rows=..., ...)")
        elif resolution is not None:
            raise InputError("geometry", "the resolution is given twice, by itself and in the geometry; give it once")
        time = checked_time(time)
        self.geometry = geometry
        self._motion = checked_motion(motion)
        shape = (geometry.rows, geometry.columns)
        new, speeds = checked(heights, velocities, shape, "the map")
        # The map of the C++ core, whose memory the arrays are.
        self.core_reader: Any = CORE.Grid(*shape)
        self.core_reader.place(*geometry.origin, geometry.yaw, geometry.resolution)
        self._heights: NDArray[np.float32] = self.core_reader.heights
        self._velocities, self._rates = self.core_reader.velocities, self.core_reader.rates
        self._offsets: NDArray[np.float32] = self.core_reader.offsets
        self._heights[...] = new
        self._clocks = self.core_reader.clocks.view(CLOCK)[..., 0]
        self.prints: Prints | None = None  # made by the first `press` of a `HeightMap`
        self._deviation: float | None = None  # standard deviation by the last update's variances [m], None = not given
        self.version = 0  # number of updates
        self._material = together(material, friction=friction, soil=soil).checked(shape)
        self.track = at_rest(geometry, time)
        self._set_motion()
        self._take(0, 0, new, speeds, time, checked_variance(variance, shape))
        self._material.tell(self.core_reader)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the map, or one in another process, is made of: arrays, and what they mean."""
        prints = self.prints
        return {
            **self._moving_state(),
            "map": {
                "geometry": self.geometry,
                "motion": self.motion,
                "material": self._material,
            },
            "heights": self._heights,
            "track": self.track,
            "deviation": self._deviation,
            "settled": float(self.core_reader.settled),
            "fused": self.core_reader.fused,
            "prints": None if prints is None else (prints.given, prints.corners),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the map of such a state."""
        MovingHeights.__init__(self, state["heights"], **state["map"])
        self._take_moving(state)
        self.track, self._deviation = state["track"], state["deviation"]
        self.core_reader.settled = state["settled"]
        if state["fused"] is not None:
            self.core_reader.begin_fusion()
            for array, kept in zip(self.core_reader.fused, state["fused"], strict=True):
                filled(array, kept)
        if state["prints"] is not None:
            self.prints = Prints(self._heights)
            given, self.prints.corners = state["prints"]
            filled(self.prints.given, given)
        self._set_motion()
        self.core_reader.show(state["shown"])

    @property
    def heights(self) -> NDArray[np.float32]:
        """The last map's heights [m], (rows, columns), without the origin's z; read-only."""
        view = self._heights.view()
        view.setflags(write=False)
        return view

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """The arrays that change in place: heights (rows, columns) [m], NaN = hole;
        velocities (KEPT, rows, columns) [m/s], a ring buffer whose newest index is in the clock of each block; clocks,
        records of ``CLOCK``, one for each block; offsets (rows, columns) [m], old minus new heights of corrections, or
        deviations of shown ground; rates (rows, columns) [m/s] of these."""
        return self._heights, self._velocities, self._clocks, self._offsets, self._rates

    @property
    def noise(self) -> float:
        """Standard deviation of the heights [m] for the estimation of velocities; 0 = exact heights."""
        return self.motion.noise if self._deviation is None else self._deviation

    def show(self, time: float) -> None:
        """Blend corrections in up to ``time`` [s]; earlier times than before have no effect."""
        time, shown = checked_time(time), self.core_reader.shown
        self.core_reader.show(time if shown == math.inf else max(shown, time))

    def replace(
        self,
        heights: ArrayLike,
        *,
        time: float,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
        friction: float | ArrayLike | None = None,
        soil: ArrayLike | None = None,
        material: Material | None = None,
    ) -> None:
        """Replace all heights (rows, columns) [m], and the layers of the material that are given; raises `InputError`
        and then changes nothing."""
        time, shape = checked_next_time(time, self.time), self._shape
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the map")
        if not (material is None and friction is None and soil is None):
            self.give(together(material, friction=friction, soil=soil))
        self._take(0, 0, new, speeds, time, certainty)
        if not self.motion.corrects:
            self.follow(self, time)

    def update_region(
        self,
        row: int,
        column: int,
        heights: ArrayLike,
        *,
        time: float,
        velocities: ArrayLike | None = None,
        variance: float | ArrayLike | None = None,
        material: Material | None = None,
    ) -> None:
        """Replace the heights (h, w) [m] of the rectangle whose first sample is (``row``, ``column``), and the layers
        of the material there that are given.

        The cost depends on the size of the rectangle, not of the map. Other samples of the blocks that the rectangle
        touches count as at rest, but for parts of one map, of the same time. Raises `InputError` and then changes
        nothing.
        """
        time, heights = checked_next_time(time, self.time), unmasked(heights, "heights of the region")
        shape = heights.shape
        row, column = checked_place(row, column, shape, self._shape)
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the region")
        if np.may_share_memory(new, self._heights):  # rows of `heights`, at another place
            new = new.copy()
        if material is not None and (laid := together(material).checked(shape)).layers:
            place = slice(row, row + shape[0]), slice(column, column + shape[1])
            self._lay(self._material.written(laid, place, self._shape))
        self._take(row, column, new, speeds, time, certainty)

    def follow(self, before: MovingHeights, time: float) -> None:
        """Estimate the rigid motion of this map of ``time`` [s] from its pose and the track of the map ``before``."""
        motion = self.motion
        self.track, _ = follow(before.track, self.geometry, time, motion.max_interval, motion.max_velocity)

    @property
    def has_velocities(self) -> bool:
        """True if vertical velocities were given or estimated."""
        return bool(self._clocks["known"].any())

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to all update times, after their clock was reset or lost time."""
        super().shift_time(by)
        self.track = self.track._replace(time=self.track.time + by, since=self.track.since + by)
        if self.motion.corrects:
            self.core_reader.show(self.core_reader.shown + by)
            self.core_reader.settled += by

    @property
    def revision(self) -> int:
        """Revision of the map: higher after every change of it, and of what is shown of it."""
        return int(self.core_reader.revision)

    @property
    def track(self) -> GridTrack:
        """Pose and rigid motion of the grid."""
        return self._track

    @track.setter
    def track(self, track: GridTrack) -> None:
        self._track = track
        self.core_reader.move(track.time, track.interval, *track.motion)

    def _set_deviation(self, deviation: float | None) -> None:
        """Set the standard deviation of the heights by the last update's variances [m]; None = not given."""
        if deviation != self._deviation:
            self._deviation = deviation
            self._set_motion()

    def _set_motion(self) -> None:
        motion = self.motion
        self.core_reader.set_motion(motion.code, motion.max_velocity, motion.settle, self.noise, motion.smoothing)

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
        if self.motion.corrects:
            certainty = self.motion.noise**2 if variance is None else variance
            known = fuse_rectangle(self.core_reader, (row, column), new, certainty, time, self._clocks)
            self._correct(row, column, known, time)
            return
        self._store(row, column, new, speeds, time)
        self._set_deviation(None if variance is None else deviation_of(variance))

    def _store(
        self, row: int, column: int, new: NDArray[np.float32], speeds: NDArray[np.float32] | None, time: float
    ) -> None:
        """Store heights of a rectangle that moves, and their velocities if they were given."""
        intervals = self.motion.min_interval, self.motion.max_interval
        with self.prints.lifted() if self.prints else nullcontext():
            CORE.take_rectangle(self.core_reader, (row, column), new, speeds, time, intervals)

    def _correct(self, row: int, column: int, known: NDArray[np.float32], time: float) -> None:
        """Store the new estimate of a rectangle of static ground."""
        CORE.take_corrected(self.core_reader, (row, column), dense(known), time)
