"""A lattice of about a hundred samples that measures changes from map to map, at the same cost for any map size.

The samples keep their positions in the world while a map scrolls by whole cells, and move with a map that slides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray

# Number of map samples per lattice point: the sample itself and its two neighbours in the row.
STENCIL = 3


class Lattice(NamedTuple):
    """State of the lattice points, a ring buffer of (n, m), for ``CORE.moved_as_one`` and ``CORE.compare_maps``.

    The latter returns the median of the changes [m], and the numbers of points that are *known* in this map and the one
    before; *changed* now and before; of these, *reversed*, with opposite signs; *tilted*, with changes that differ from
    those of both neighbours; of these, *agreeing*, with differences of the same sign; and the *tilt* [m], the sum of
    the differences to one neighbour.

    ``cells`` (n, m, 2): row and column of each point in the lattice of the world. ``heights`` (n, m, STENCIL) [m]: last
    heights there, NaN = unknown. ``steps`` (n, m) [m]: last change of each point, zero = none yet. ``stride``: distance
    between lattice points along rows and columns [samples of the map].
    """

    cells: NDArray[np.int64]
    heights: FloatArray
    steps: FloatArray
    stride: tuple[int, int]


def lattice_of(shape: tuple[int, ...], samples: int) -> Lattice:
    """Return an empty lattice for maps of ``shape`` (rows, columns), with about ``samples`` points along each side."""
    rows, columns = (max(-(-size // samples), 1) for size in shape)
    n, m = -(-shape[0] // rows) + 1, -(-shape[1] // columns) + 1  # one more if the map is not aligned
    return Lattice(np.zeros((n, m, 2), np.int64), np.full((n, m, STENCIL), math.nan), np.zeros((n, m)), (rows, columns))
