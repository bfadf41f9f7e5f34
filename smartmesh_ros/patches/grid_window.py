"""The main mesh around bodies, and how much of it their bounding spheres can touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Sizes of windows [rings]: few, so that bodies of about one size share a pass.
SIZES = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64])


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """Samples around n bodies, ``rings`` on each side of a middle one, ``resolution`` [m] apart.

    ``heights`` (n, S, S) [m], S = 2 rings + 1; ``ahead``: the same when the bodies are looked at next, None = no other.
    ``holes``: whether any sample may be NaN.
    The frame is the grid's own with the middle sample as its origin: x along the columns, y along the rows, z as in the
    world. Ground moves in a straight line between two looks, so what is linear in it is largest at one of them.
    """

    heights: FloatArray
    rings: int
    resolution: float
    ahead: FloatArray | None = None
    holes: bool = True

    @property
    def instants(self) -> list[FloatArray]:
        """Heights now and, where the ground moves, at the next look."""
        return [self.heights] if self.ahead is None else [self.heights, self.ahead]

    def at_next_look(self) -> Window:
        """The window at that instant alone."""
        assert self.ahead is not None
        return Window(heights=self.ahead, rings=self.rings, resolution=self.resolution, holes=self.holes)

    def inner(self, rows: IntArray | slice, rings: int) -> Window:
        """The middle of the windows of the bodies in ``rows``."""
        cut = slice(self.rings - rings, self.rings + rings + 1)
        ahead = None if self.ahead is None else self.ahead[rows, cut, cut]
        return Window(
            heights=self.heights[rows, cut, cut], ahead=ahead, rings=rings, resolution=self.resolution, holes=self.holes
        )

    def places(self) -> FloatArray:
        """x of the columns, or y of the rows (S,) [m]."""
        places: FloatArray = np.arange(-self.rings, self.rings + 1, dtype=np.float64) * self.resolution
        return places


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
        """Those in ``rows``."""
        return Balls(centres=self.centres[rows], radii=self.radii[rows], lateral=self.lateral[rows])


def window_rings(reach: FloatArray, resolution: float) -> IntArray:
    """Rings of a window around the nearest vertex that shows all ground within ``reach`` (n,) [m] horizontally.

    Beyond the largest size a body is larger than the product's windows; it gets the largest.
    """
    cells = np.ceil(reach / resolution + 0.5 - 1e-9).astype(np.int64)
    return np.asarray(SIZES[np.minimum(np.searchsorted(SIZES, cells), len(SIZES) - 1)])
