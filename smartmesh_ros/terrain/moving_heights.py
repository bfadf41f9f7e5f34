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
    checked_next_time,
    checked_time,
    checked_variance,
    dense,
    deviation_of,
    require_region,
    unmasked,
)
from smartmesh_ros.terrain.corrections import Corrections, untouched_zeros
from smartmesh_ros.terrain.grid import GridGeometry, geometry_of
from smartmesh_ros.terrain.grid_track import at_rest, follow
from smartmesh_ros.terrain.material import Material, together
from smartmesh_ros.terrain.motion import BLOCK, CLOCK, KEPT, MotionConfig, MovingGround, next_revision
from smartmesh_ros.terrain.prints import Prints


class MovingHeights(MovingGround):
    """What a `HeightMap` stores: heights, their last velocities and update times, corrections, material, and the motion
    of the grid. All change in place; the core reads the same arrays."""

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
        self._material = together(material, friction=friction, soil=soil).checked(shape)
        self.soil_revision = 0  # changes with every assignment of the soil
        self.track = at_rest(geometry, time)  # pose and rigid motion of the grid
        self._tell_core()
        self._take(0, 0, new, speeds, time, checked_variance(variance, shape))
        self._tell_core()
        self._material.tell(self.core_reader)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy of the map, or one in another process, is made of: arrays, and what they mean."""
        corrections, prints = self.corrections, self.prints
        return {
            "map": {
                "geometry": self.geometry,
                "motion": self.motion,
                "material": self._material,
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
        self._clocks[...] = state["clocks"]
        for array, kept in zip(self._others, state["others"], strict=True):
            if kept is not None:
                array[...] = kept
        self.track, self.version, self._deviation = state["track"], state["version"], state["deviation"]
        self.corrections.shown, self.corrections.settled = state["corrections"]
        self.corrections.fused = None if state["fused"] is None else state["fused"].copied()
        if state["prints"] is not None:
            self.prints = Prints(self._heights)
            self.prints.given[...], self.prints.corners = state["prints"]
        self._tell_core()
        self.core_reader.show(state["shown"])

    @property
    def _shape(self) -> tuple[int, int]:
        return self.geometry.rows, self.geometry.columns

    @property
    def heights(self) -> NDArray[np.float32]:
        """The last map's heights [m], (rows, columns), without the origin's z; read-only."""
        view = self._heights.view()
        view.setflags(write=False)
        return view

    @property
    def material(self) -> Material:
        """What the ground is made of; its layers are numbers, or read-only arrays (rows, columns).

        Assign another to replace it; raises `InputError` and then changes nothing. `give` replaces some layers.
        """
        return self._material

    @material.setter
    def material(self, material: Material) -> None:
        self._lay(material.checked(self._shape))

    def give(self, material: Material) -> None:
        """Replace the layers of the ground that a material has; raises `InputError` and then changes nothing."""
        self._lay(material.checked(self._shape).over(self._material))

    @property
    def friction(self) -> float | NDArray[np.float32]:
        """Coefficient of friction of the `material`, by which that of a body is multiplied; may be assigned."""
        friction: Any = self._material.friction
        return 1.0 if friction is None else friction

    @friction.setter
    def friction(self, friction: float | ArrayLike) -> None:
        self.give(Material(friction=friction))

    @property
    def soil(self) -> NDArray[np.uint8] | None:
        """Which soil each sample is, of the `material`: its place in the list of a `Soil` (rows, columns); None = the
        first everywhere; may be assigned. `Ground.update` tells its `Soil`."""
        soil = self._material.soil
        return None if soil is None else np.asarray(soil, np.uint8)

    @soil.setter
    def soil(self, soil: ArrayLike) -> None:
        self.give(Material(soil=soil))

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
        material: Material | None = None,
    ) -> None:
        """Replace all heights (rows, columns) [m], and the layers of the material that are given; raises `InputError`
        and then changes nothing."""
        time, shape = checked_next_time(time, self.time), self._shape
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the map")
        laid = together(material, friction=friction, soil=soil).checked(shape)
        if laid.layers:
            self._lay(laid.over(self._material))
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
        material: Material | None = None,
    ) -> None:
        """Replace the heights (h, w) [m] of the rectangle whose first sample is (``row``, ``column``), and the layers
        of the material there that are given.

        The cost depends on the size of the rectangle, not of the map. Other samples of the blocks that the rectangle
        touches count as at rest. Raises `InputError` and then changes nothing.
        """
        time, heights = checked_next_time(time, self.time), unmasked(heights, "heights of the region")
        shape = heights.shape
        require_region(row, column, shape, self._shape)
        certainty = checked_variance(variance, shape)
        new, speeds = checked(heights, velocities, shape, "the region")
        laid = (material or Material()).checked(shape)
        if laid.layers:
            place = slice(row, row + shape[0]), slice(column, column + shape[1])
            self._lay(self._material.written(laid, place, self._shape))
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

    def _lay(self, material: Material) -> None:
        """Replace the material by one that was checked."""
        before, self._material = self._material, material
        self.revision = next_revision()
        if material.soil is not before.soil:
            self.soil_revision = self.revision
        self._clocks["updates"] += 1  # what rests on the ground looks at it again
        material.tell(self.core_reader)

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
