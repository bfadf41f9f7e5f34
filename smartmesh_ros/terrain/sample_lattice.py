"""A lattice of about a hundred samples that measures changes from map to map, at the same cost for any map size.

The samples keep their positions in the world while a map scrolls by whole cells, and move with a map that slides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.grid import FloatArray

FloatGrid = NDArray[np.float32]
# Number of map samples per lattice point: the sample itself and its two neighbours in the row.
STENCIL = 3


class Lattice(NamedTuple):
    """State of the lattice points, a ring buffer of (n, m).

    ``cells`` (n, m, 2): row and column of each point in the lattice of the world. ``heights`` (n, m, STENCIL) [m]: last
    heights there, NaN = unknown. ``steps`` (n, m) [m]: last change of each point, zero = none yet. ``stride``: distance
    between lattice points along rows and columns [samples of the map].
    """

    cells: NDArray[np.int64]
    heights: FloatArray
    steps: FloatArray
    stride: tuple[int, int]


class Counts(NamedTuple):
    """Numbers of lattice points.

    ``known``: in this map and the one before. ``changed``: now and before. ``reversed``: of these, with opposite signs.
    ``tilted``: with changes that differ from those of both neighbours. ``agreeing``: of these, with differences of the
    same sign. ``tilt`` [m]: sum of the differences to one neighbour.
    """

    known: float
    changed: float
    reversed: float
    tilted: float
    agreeing: float
    tilt: float

    def after(self, before: Counts, fading: float) -> Counts:
        """Return these numbers and those ``before``, which decay by the factor ``fading`` [-]."""
        return Counts(*(fading * old + new for old, new in zip(before, self, strict=True)))


NO_COUNTS = Counts(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def lattice_of(shape: tuple[int, ...], samples: int) -> Lattice:
    """Return an empty lattice for maps of ``shape`` (rows, columns), with about ``samples`` points along each side."""
    rows, columns = (max(-(-size // samples), 1) for size in shape)
    places = (-(-shape[0] // rows) + 1, -(-shape[1] // columns) + 1)  # one more if the map is not aligned
    return Lattice(
        np.zeros((*places, 2), np.int64), np.full((*places, STENCIL), math.nan), np.zeros(places), (rows, columns)
    )


def moved_as_one(lattice: Lattice, heights: FloatGrid, z: float, first: tuple[int, int], least: float) -> bool:
    """Return True if the samples of a map differ from those with the same indices in the map before by a constant.

    Then the ground moved together with the map. ``least`` [m]: tolerance. Other arguments as in `compare`.
    """
    return bool(CORE.moved_as_one(*lattice, heights, z, first, least))


def compare(
    lattice: Lattice, heights: FloatGrid, z: float, first: tuple[int, int], least: float
) -> tuple[Counts, float]:
    """Return the `Counts` of a map compared to the map before, and the median of the changes [m].

    ``heights`` (rows, columns) [m]: above ``z`` [m]. ``first``: row and column of sample (0, 0) in the world [samples].
    Changes below ``least`` [m] are ignored.
    """
    counts, median = CORE.compare_maps(*lattice, heights, z, first, least)
    return Counts(*counts), median
