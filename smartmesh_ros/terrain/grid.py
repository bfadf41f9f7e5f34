"""Where the samples of a height map lie."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# More samples than this cannot be held in memory as floats by any machine the project knows (2**31 * 4 bytes = 8 GiB).
MOST_SAMPLES = 2**31
# Where a map may lie, and how far apart its samples: beyond this, cells can no longer be counted in doubles [m].
MAX_COORDINATE = 1e9
RESOLUTION_RANGE = (1e-6, 1e6)


@dataclass(frozen=True, kw_only=True)
class GridGeometry:
    """A uniform grid of ``rows`` x ``columns`` vertices in the terrain's frame (z up).

    Rows run along the grid's own +y axis and columns along its +x axis; ``origin`` is the position of sample (0, 0) in
    metres (its z is added to every height) and ``yaw`` [rad] turns the grid about z. ``resolution`` is the distance
    between neighbouring samples [m].
    """

    rows: int
    columns: int
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0

    def __post_init__(self) -> None:
        if self.rows < 3 or self.columns < 3:
            raise InputError(
                "geometry",
                f"a map of {self.rows} x {self.columns} samples has no vertex inside its rim; it needs at least 3 x 3",
            )
        if self.rows * self.columns > MOST_SAMPLES:
            raise InputError(
                "size", f"{self.rows} x {self.columns} samples are too many; at most {MOST_SAMPLES} are possible"
            )
        if not (math.isfinite(self.resolution) and self.resolution > 0.0):
            raise InputError("geometry", f"resolution is {self.resolution} m; it must be finite and greater than zero")
        if len(self.origin) != 3 or not all(math.isfinite(value) for value in self.origin):
            raise InputError("geometry", f"origin is {self.origin}; it must be three finite numbers [m]")
        if not RESOLUTION_RANGE[0] <= self.resolution <= RESOLUTION_RANGE[1] or max(map(abs, self.origin)) > MAX_COORDINATE:
            raise InputError(
                "geometry",
                f"resolution {self.resolution} m at origin {self.origin}: it must be {RESOLUTION_RANGE[0]:g} to "
                f"{RESOLUTION_RANGE[1]:g} m, at most {MAX_COORDINATE:g} m from the frame's origin",
            )
        if not math.isfinite(self.yaw):
            raise InputError("geometry", f"yaw is {self.yaw}; it must be a finite angle [rad]")

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.rows * self.columns

    @cached_property
    def last(self) -> FloatArray:
        """Row and column of the last sample (2,)."""
        return np.array([self.rows - 1.0, self.columns - 1.0])

    @cached_property
    def last_inside(self) -> IntArray:
        """Row and column of the last sample that is not on the rim (2, 1)."""
        return np.array([[self.rows - 2], [self.columns - 2]])

    @cached_property
    def _corner(self) -> FloatArray:
        return np.array([self.origin[1], self.origin[0]])

    def to_grid(self, xy_w: FloatArray) -> FloatArray:
        """Fractional (row, column) of points; shape (..., 2) in [m] to shape (..., 2) in samples."""
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
        """Horizontal position of (fractional) samples; broadcast shapes (...) to shape (..., 2) in [m]."""
        cos, sin = math.cos(self.yaw) * self.resolution, math.sin(self.yaw) * self.resolution
        x = self.origin[0] + np.multiply(columns, cos) - np.multiply(rows, sin)
        y = self.origin[1] + np.multiply(columns, sin) + np.multiply(rows, cos)
        return np.stack([x, y], axis=-1)


def overlap(moved: int, size: int) -> tuple[slice, slice]:
    """The samples that an axis of ``size`` shares with the one before it, by which it was ``moved`` by so many: in the
    new axis, and in the old one."""
    shared = max(size - abs(moved), 0)
    new, old = (0, size - shared) if moved > 0 else (size - shared, 0)
    return slice(new, new + shared), slice(old, old + shared)
