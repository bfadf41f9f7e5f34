"""Positions of the samples of a height map."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import index
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError, as_float

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# Maximum number of samples of a map: 2**31 float32 heights take 8 GiB.
MOST_SAMPLES = 2**31
# Largest coordinate of a map's origin, and smallest and largest resolution [m]. Beyond these limits the precision of
# doubles does not suffice to tell cells apart.
MAX_COORDINATE = 1e9
RESOLUTION_RANGE = (1e-6, 1e6)


@dataclass(frozen=True, kw_only=True)
class GridGeometry:
    """A uniform grid of ``rows`` x ``columns`` vertices in the terrain's frame (z up).

    Rows run along the grid's own +y axis and columns along its +x axis. ``origin`` [m]: position of sample (0, 0); its
    z is added to every height. ``yaw`` [rad]: rotation of the grid about z. ``resolution`` [m]: distance between
    neighbouring samples.
    """

    rows: int
    columns: int
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0

    def __post_init__(self) -> None:
        try:  # numbers of NumPy overflow
            object.__setattr__(self, "rows", index(self.rows))
            object.__setattr__(self, "columns", index(self.columns))
            object.__setattr__(self, "origin", tuple(map(float, self.origin)))  # to be compared
        except (TypeError, ValueError):
            raise InputError(
                "geometry", f"a grid has {self.rows!r} rows, {self.columns!r} columns and the origin {self.origin!r}; "
                "the first two must be whole numbers, the last three numbers [m]"
            ) from None  # fmt: skip
        if self.rows < 3 or self.columns < 3:
            words = "samples has no vertex inside its rim; it needs at least 3 x 3"
            raise InputError("geometry", f"a map of {self.rows} x {self.columns} {words}")
        if self.rows * self.columns > MOST_SAMPLES:
            raise InputError("size", f"{self.rows} x {self.columns} samples are too many; at most {MOST_SAMPLES}")
        if not 0.0 < as_float(self.resolution) < math.inf:
            raise InputError("geometry", f"resolution is {self.resolution} m; it must be finite and greater than zero")
        if len(self.origin) != 3 or not all(math.isfinite(value) for value in self.origin):
            raise InputError("geometry", f"origin is {self.origin}; it must be three finite numbers [m]")
        finest, coarsest = RESOLUTION_RANGE
        if not finest <= self.resolution <= coarsest or max(map(abs, self.origin)) > MAX_COORDINATE:
            raise InputError(
                "geometry",
                f"resolution {self.resolution} m at origin {self.origin}: the resolution must be {finest:g} to "
                f"{coarsest:g} m, and no coordinate of the origin above {MAX_COORDINATE:g} m",
            )
        if not abs(as_float(self.yaw)) <= math.tau:  # also True for NaN
            raise InputError(
                "geometry", f"yaw is {self.yaw} rad; it must be within a turn, -2 pi to 2 pi: convert degrees with "
                "math.radians, and take whole turns off with math.remainder(yaw, math.tau)"
            )  # fmt: skip

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.rows * self.columns

    @cached_property
    def last(self) -> FloatArray:
        """Row and column of the last sample (2,)."""
        return np.array([self.rows - 1.0, self.columns - 1.0])

    @cached_property
    def _corner(self) -> FloatArray:
        return np.array([self.origin[1], self.origin[0]])

    def to_grid(self, xy_w: FloatArray) -> FloatArray:
        """Return the fractional (row, column) of points; shape (..., 2) [m] to shape (..., 2) [samples]."""
        if not self.yaw:
            offset: FloatArray = xy_w[..., 1::-1] - self._corner
            offset *= 1.0 / self.resolution
            return offset
        cos, sin = math.cos(self.yaw) / self.resolution, math.sin(self.yaw) / self.resolution
        dx = xy_w[..., 0] - self.origin[0]
        dy = xy_w[..., 1] - self.origin[1]
        grid = np.empty((*dx.shape, 2))
        np.add(dy * cos, dx * -sin, out=grid[..., 0])
        np.add(dx * cos, dy * sin, out=grid[..., 1])
        return grid

    def to_world(self, rows: Any, columns: Any) -> FloatArray:
        """Return the horizontal positions of (fractional) samples; broadcast shapes (...) to shape (..., 2) [m]."""
        cos, sin = math.cos(self.yaw) * self.resolution, math.sin(self.yaw) * self.resolution
        x = self.origin[0] + np.multiply(columns, cos) - np.multiply(rows, sin)
        y = self.origin[1] + np.multiply(columns, sin) + np.multiply(rows, cos)
        return np.stack([x, y], axis=-1)


class Region(NamedTuple):
    """Heights (h, w) [m] of the rectangle whose first sample is (``row``, ``column``), relative to the map's z."""

    row: int
    column: int
    heights: NDArray[np.float32]


def geometry_of(shape: tuple[int, ...], resolution: float | None, origin: Sequence[float], yaw: float) -> GridGeometry:
    """Return the grid of an array of heights of a ``shape``; an ``origin`` of two numbers lies at z = 0. Raises
    `InputError`."""
    if len(shape) != 2:
        raise InputError("length", f"heights have shape {shape}; it must be (rows, columns)")
    if resolution is None:
        raise InputError("geometry", "resolution is missing; pass resolution=..., the distance of the samples [m]")
    try:
        place, resolution, yaw = [float(value) for value in origin], float(resolution), float(yaw)
    except (TypeError, ValueError):
        raise InputError(
            "geometry", f"resolution is {resolution!r}, origin {origin!r} and yaw {yaw!r}; they must be numbers"
        ) from None
    if len(place) not in (2, 3):
        raise InputError("geometry", f"origin is {origin!r}; it must be x, y or x, y, z of sample (0, 0) [m]")
    x, y, z = [*place, 0.0][:3]
    return GridGeometry(rows=shape[0], columns=shape[1], resolution=resolution, origin=(x, y, z), yaw=yaw)


def overlap(moved: tuple[int, int], shape: tuple[int, ...]) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the samples that a grid of a ``shape`` shares with itself after it ``moved`` by (rows, columns): as slices
    of the moved grid, and of the old one."""
    new, old = [], []
    for by, size in zip(moved, shape, strict=True):
        shared = max(size - abs(by), 0)
        first, before = (0, size - shared) if by > 0 else (size - shared, 0)
        new.append(slice(first, first + shared))
        old.append(slice(before, before + shared))
    return tuple(new), tuple(old)
