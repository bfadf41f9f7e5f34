"""The main mesh around bodies, and how much of it their bounding spheres can touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Sizes of windows [rings]: few, so that bodies of about one size share a pass.
SIZES = np.array([1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 32, 40, 48, 64])


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """Samples around n bodies, ``rings`` on each side of a middle one, ``resolution`` [m] apart.

    ``heights`` (t, n, S, S) [m], S = 2 rings + 1: now and, where the ground moves, t = 2, when the bodies are looked at
    next. Ground moves in a straight line between two looks, so what is linear in it is largest at one of them.
    ``holes``: whether any sample may be NaN.
    The frame is the grid's own with the middle sample as its origin: x along the columns, y along the rows, z as in the
    world.
    """

    heights: FloatArray
    rings: int
    resolution: float
    holes: bool = True

    @property
    def instants(self) -> int:
        """Number of instants t."""
        return len(self.heights)

    @property
    def stacked(self) -> FloatArray:
        """Heights with the instants one after the other (t n, S, S)."""
        return self.heights.reshape(-1, *self.heights.shape[2:])

    def inner(self, rows: IntArray, rings: int) -> Window:
        """The middle of the windows of the bodies in ``rows``, ascending (m,)."""
        cut = slice(self.rings - rings, self.rings + rings + 1)
        every = len(rows) == self.heights.shape[1]
        heights = self.heights[:, :, cut, cut] if every else self.heights[:, rows, cut, cut]
        return Window(heights=heights, rings=rings, resolution=self.resolution, holes=self.holes)

    def places(self) -> FloatArray:
        """x of the columns, or y of the rows (S,) [m]."""
        places: FloatArray = np.arange(-self.rings, self.rings + 1, dtype=np.float64) * self.resolution
        return places

    def worst(self, values: FloatArray) -> FloatArray:
        """The largest over the instants (n,) of values (t n,)."""
        worst: FloatArray = values if self.instants == 1 else values.reshape(self.instants, -1).max(axis=0)
        return worst


@dataclass(frozen=True, kw_only=True, eq=False)
class Balls:
    """What n bodies can touch until they are looked at again, in the frame of their windows.

    ``centres`` (n, 3) [m]; ``radii`` (n,): bounding radius and how much nearer the body may come; ``lateral`` (n,): how
    far it may slide along the ground [m].
    """

    centres: FloatArray
    radii: FloatArray
    lateral: FloatArray

    def of(self, rows: IntArray) -> Balls:
        """Those in ``rows``, ascending (m,)."""
        if len(rows) == len(self.radii):
            return self
        return Balls(centres=self.centres[rows], radii=self.radii[rows], lateral=self.lateral[rows])

    def repeated(self, times: int) -> Balls:
        """The same so many times over, one after the other, as the instants of a window are."""
        if times == 1:
            return self
        centres = np.concatenate([self.centres] * times)
        return Balls(
            centres=centres, radii=np.concatenate([self.radii] * times), lateral=np.concatenate([self.lateral] * times)
        )


def window_rings(reach: FloatArray, resolution: float) -> IntArray:
    """Rings of a window around the nearest vertex that shows all ground within ``reach`` (n,) [m] horizontally.

    Beyond the largest size a body is larger than the product's windows; it gets the largest.
    """
    cells = np.ceil(reach / resolution + 0.5 - 1e-9).astype(np.int64)
    return np.asarray(SIZES[np.minimum(np.searchsorted(SIZES, cells), len(SIZES) - 1)])
