"""The main mesh as a height map that deforms in place."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain import triangles
from smartmesh_ros.terrain.clocks import BlockClocks, Blocks
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, IntArray
from smartmesh_ros.terrain.memory import untouched_zeros
from smartmesh_ros.terrain.motion import REST, MotionConfig

# How far outside a point may lie and still count as on the edge [samples].
EDGE = 1e-6
# Larger maps take memory for the heights before only as they move: first regions at a place cost more, as long as it
# takes to find that memory [bytes].
LARGE = 64 * 2**20


class Samples(NamedTuple):
    """Ground at a set of samples: heights [m] (NaN = no ground) and vertical velocities [m/s], same shape; None where
    all of it is at rest."""

    heights: FloatArray
    velocities: FloatArray | None


class HeightMap:
    """Heights on a uniform grid, their holes, and how fast they move.

    ``heights``: (rows, columns) array [m], kept as float32 and copied; NaN = no ground. ``resolution``, ``origin`` and
    ``yaw`` place it (see `GridGeometry`; an origin of two numbers lies at z = 0), or pass a ``geometry``. ``time`` [s]
    is the instant the heights hold for, on the clock of `Ground` or `World`. ``velocities`` [m/s], same shape, says how
    fast the ground rises; without it velocity is the difference of successive heights.

    Beside the heights the map keeps the heights before them, so that velocity is worked out only where a body stands,
    and for each block of 64 x 64 samples the time of its last update.
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
        self.motion = motion or MotionConfig()
        new, speeds, self._has_holes = _checked(heights, velocities, (geometry.rows, geometry.columns), "the map")
        self._heights = np.array(new, order="C")
        # Without velocities nothing is known of before, and nothing reads it until a later map has written it.
        if speeds is not None:
            self._before = self._heights - speeds
        else:
            self._before = untouched_zeros(new.shape) if new.nbytes > LARGE else self._heights.copy()
        self.clocks = BlockClocks(geometry.rows, geometry.columns)
        self.velocity_given = False  # whether the last velocity was given, and not worked out
        self.slide_w = (0.0, 0.0)  # horizontal velocity while it moves [m/s]
        self.version = 0  # counts the updates
        self._set_clock(self.clocks.all, time, given=speeds is not None)

    @property
    def heights(self) -> NDArray[np.float32]:
        """The last map's heights [m], (rows, columns), without the origin's z; read-only."""
        view = self._heights.view()
        view.setflags(write=False)
        return view

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.geometry.size

    @property
    def description(self) -> str:
        """Size and kind, in words."""
        return f"{self.geometry.rows} x {self.geometry.columns} at {self.geometry.resolution:g} m"

    @property
    def lifetime(self) -> float:
        """Expected time from the last update to the next, of ground that moves [s]; 0 = none is expected."""
        return self.clocks.stream.lifetime

    @property
    def has_holes(self) -> bool:
        """Whether any sample may be NaN."""
        return self._has_holes

    @property
    def time(self) -> float:
        """Time of the newest sample [s]."""
        return self.clocks.latest

    def replace(self, heights: ArrayLike, *, time: float, velocities: ArrayLike | None = None) -> None:
        """Takes a whole new map of the same geometry, (rows, columns) [m]; raises `InputError` and changes nothing."""
        shape = (self.geometry.rows, self.geometry.columns)
        new, speeds, has_holes = _checked(heights, velocities, shape, "the map")
        # Swapping the two buffers saves a copy; not where a block is corrected, whose heights before must stay.
        if speeds is None:
            if self.clocks.before(time, self.clocks.all) == [self.clocks.all]:
                self._heights, self._before = self._before, self._heights
            else:
                self._keep_before(self.clocks.all, time)
        self._heights[...] = new
        if speeds is not None:
            np.subtract(self._heights, speeds, out=self._before)
        self._has_holes = has_holes
        self._set_clock(self.clocks.all, time, given=speeds is not None)

    def update_region(
        self, row: int, column: int, heights: ArrayLike, *, time: float, velocities: ArrayLike | None = None
    ) -> None:
        """Takes new heights (h, w) [m] for the rectangle whose first sample is (``row``, ``column``).

        Costs the rectangle, not the map. Samples that share a block with the rectangle but lie outside it are taken as
        at rest. Raises `InputError` and changes nothing.
        """
        shape = np.shape(heights)
        if len(shape) != 2 or 0 in shape:
            raise InputError("length", f"a region needs (rows, columns) of at least 1 x 1 samples, not {shape}")
        end_row, end_column = row + shape[0], column + shape[1]
        rows, columns = self.geometry.rows, self.geometry.columns
        if row < 0 or column < 0 or end_row > rows or end_column > columns:
            raise InputError(
                "region",
                f"rows {row} to {end_row - 1} and columns {column} to {end_column - 1} leave the map, whose last "
                f"sample is row {rows - 1}, column {columns - 1}",
            )
        new, speeds, has_holes = _checked(heights, velocities, shape, "the region")
        region = (slice(row, end_row), slice(column, end_column))
        blocks = self.clocks.around(row, column, end_row, end_column)
        if speeds is None:
            self._keep_before(blocks, time)
        else:
            around = self.clocks.samples(blocks)
            self._before[around] = self._heights[around]
        self._heights[region] = new
        if speeds is not None:
            self._before[region] = self._heights[region] - speeds
        self._has_holes |= has_holes
        self._set_clock(blocks, time, given=speeds is not None)

    def moving(self, time: float) -> bool:
        """Whether any sample may move at ``time`` [s]."""
        return time < self.clocks.moves_until

    @property
    def steady_until(self) -> float:
        """Until when, from the newest sample's time on, every sample goes on with the velocity it has [s]; -inf where
        nothing can be said."""
        return self.clocks.stream.steady_until if self.motion.mode == "extrapolate" else -math.inf

    def slide(self, velocity_w: tuple[float, float], interval: float) -> None:
        """Has the ground carry a horizontal velocity [m/s] while maps come every ``interval`` [s], about."""
        self.slide_w = velocity_w
        if velocity_w != (0.0, 0.0):
            self.clocks.moves_until = max(self.clocks.moves_until, self.time + REST * interval)

    def shift_time(self, by: float) -> None:
        """Moves the times of the updates by so many seconds, when the clock they are stamped with is set anew."""
        self.clocks.shift(by)

    def sample(self, indices: IntArray, centres: IntArray, time: float, *, velocities: bool = True) -> Samples:
        """Ground at ``time`` [s] at N x K samples, as ``indices`` (N, K) into the row-major map.

        ``centres`` (N,) are the samples that say how old each row of ``indices`` is. Heights include the origin's z.
        Without ``velocities`` the heights are the same and nothing else is worked out that they do not need.
        """
        heights = self._heights.reshape(-1).take(indices).astype(np.float64)
        found = None
        if self.moving(time):
            interval, offset, rate = self.clocks.progress(self.motion.mode, centres, time)
            if velocities or np.any(offset):
                found = heights - self._before.reshape(-1).take(indices)
                found /= interval
                fastest = np.abs(found).max(initial=0.0)
                if not fastest <= self.motion.max_velocity:
                    # NaN where the sample was or is a hole; too fast is a jump, not a motion.
                    found[~(np.abs(found) <= self.motion.max_velocity)] = 0.0
                heights += found * offset
                found *= rate
        if self.geometry.origin[2]:
            heights += self.geometry.origin[2]
        return Samples(heights, found)

    def beyond(self, xy_w: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far points (N, 2+) lie beyond the map's edge (N,) [m], zero or less inside, and where they are as
        fractional (row, column) (N, 2)."""
        geometry = self.geometry
        grid = geometry.to_grid(xy_w)
        over = np.maximum(-grid, grid - geometry.last).max(axis=1)
        # A point on the edge is inside, whatever rounding says.
        return (over - EDGE) * geometry.resolution, grid

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Ground under N points (N, 2) [m] at ``time`` [s]; NaN outside the map and over holes. Shapes (N,)."""
        points = np.atleast_2d(np.asarray(xy_w, np.float64))
        beyond, grid = self.beyond(points)
        samples = self._at_grid(grid, time)
        samples.heights[beyond > 0.0] = np.nan
        return samples

    def at_edge(self, xy_w: FloatArray, time: float) -> Samples:
        """The same for points (N, 2) [m] outside, at the point of the map that is nearest to each."""
        geometry = self.geometry
        return self._at_grid(np.clip(geometry.to_grid(xy_w), 0, (geometry.rows - 1, geometry.columns - 1)), time)

    def _at_grid(self, grid: FloatArray, time: float) -> Samples:
        """Ground at fractional (row, column) (N, 2); outside the map its outermost triangles are continued."""
        geometry = self.geometry
        points = triangles.locate(grid, geometry.rows, geometry.columns)
        indices = geometry.flat_index(points.rows, points.columns)
        corners = self.sample(indices, indices[:, 0], time)
        used = points.weights > 0.0
        heights = np.where(used, corners.heights, 0.0) * points.weights
        velocities = None
        if corners.velocities is not None:
            velocities = (corners.velocities * points.weights).sum(axis=1)
        return Samples(heights.sum(axis=1), velocities)

    def _keep_before(self, blocks: Blocks, time: float) -> None:
        """Keeps the heights as those before, in ``blocks`` that are not merely corrected at ``time`` [s]."""
        for part in self.clocks.before(time, blocks):
            around = self.clocks.samples(part)
            self._before[around] = self._heights[around]

    def _set_clock(self, blocks: Blocks, time: float, *, given: bool) -> None:
        """Notes that ``blocks`` were updated at ``time`` [s], with a ``given`` velocity or one to be worked out."""
        self.version += 1
        self.velocity_given = given
        self.clocks.update(blocks, time, self.version, self.motion.max_interval, given=given)


def _checked(
    heights: ArrayLike, velocities: ArrayLike | None, shape: tuple[int, ...], what: str
) -> tuple[NDArray[np.float32], NDArray[np.float32] | None, bool]:
    """Heights and velocities as float32 of the right shape without infinities, and whether there are holes."""
    new = _as_floats(heights, shape, f"heights of {what}")
    has_holes = not np.isfinite(new.sum())  # one fast pass; the slow one only where it says so
    if has_holes and _has_infinity(new):
        raise InputError("non_finite", f"heights of {what} contain infinity; mark missing ground with NaN")
    if velocities is None:
        return new, None, has_holes
    speeds = _as_floats(velocities, shape, f"velocities of {what}")
    if _has_infinity(speeds):
        raise InputError("non_finite", f"velocities of {what} contain infinity; they must be finite or NaN [m/s]")
    return new, speeds, has_holes


def _has_infinity(values: NDArray[np.float32]) -> bool:
    """Whether there is an infinity among numbers and NaN, without an array of answers as `numpy.isinf` makes one."""
    return bool(np.isinf([np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)]).any())


def _as_floats(values: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float32]:
    array = np.asarray(values)
    if array.shape != shape:
        raise InputError("length", f"{what} have shape {array.shape}; it must be {shape}")
    if array.dtype.kind not in "fiu":
        raise InputError("type", f"{what} are of type {array.dtype}; they must be real numbers")
    with np.errstate(over="ignore"):  # becomes infinity, which is refused
        return array.astype(np.float32, copy=False)
