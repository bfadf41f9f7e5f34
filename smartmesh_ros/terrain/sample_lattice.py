"""A lattice of about a hundred samples that measures changes from map to map, at the same cost for any map size.

The samples keep their positions in the world while a map scrolls by whole cells, and move with a map that slides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
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


NO_COUNTS = Counts(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def lattice_of(shape: tuple[int, ...], samples: int) -> Lattice:
    """Return an empty lattice for maps of ``shape`` (rows, columns), with about ``samples`` points along each side."""
    rows, columns = (max(-(-size // samples), 1) for size in shape)
    places = (-(-shape[0] // rows) + 1, -(-shape[1] // columns) + 1)  # one more if the map is not aligned
    return Lattice(
        np.zeros((*places, 2), np.int64), np.full((*places, STENCIL), math.nan), np.zeros(places), (rows, columns)
    )


@compiled
def height_at(heights: FloatGrid, z: float, row: int, column: int) -> float:
    """Return the height of a sample [m]; NaN beyond the edge."""
    rows, columns = heights.shape
    return z + float(heights[row, column]) if 0 <= row < rows and 0 <= column < columns else math.nan


@compiled
def moved_as_one(
    lattice: Lattice, heights: FloatGrid, z: float, first_row: int, first_column: int, least: float
) -> bool:
    """Return True if the samples of a map differ from those with the same indices in the map before by a constant.

    Then the ground moved together with the map. ``least`` [m]: tolerance.
    """
    known, rise = 0, 0.0
    for i in range(lattice.cells.shape[0]):
        for j in range(lattice.cells.shape[1]):
            row = lattice.cells[i, j, 0] * lattice.stride[0] - first_row
            column = lattice.cells[i, j, 1] * lattice.stride[1] - first_column
            change = height_at(heights, z, row, column) - lattice.heights[i, j, 1]
            if math.isnan(change):
                continue
            if known == 0:
                rise = change
            if abs(change - rise) > least:
                return False
            known += 1
    return known > 0


@compiled
def compare(
    lattice: Lattice, heights: FloatGrid, z: float, first_row: int, first_column: int, least: float,
    before: Counts, fading: float,
) -> tuple[Counts, float]:  # fmt: skip
    """Return the `Counts` of a map compared to the map before, and the median of the changes [m].

    Counts are added to those ``before``, which decay by the factor ``fading`` [-]. ``first_row``, ``first_column``:
    position of sample (0, 0) in the world [samples]. Changes below ``least`` [m] are ignored.
    """
    rows, columns = heights.shape
    down, along = lattice.stride
    high, wide = lattice.steps.shape
    sizes = np.empty(lattice.steps.size)
    known, changed, reverses, tilted, agreeing, tilt = 0, 0, 0, 0, 0, 0.0
    for i in range(-(-first_row // down), (first_row + rows - 1) // down + 1):
        for j in range(-(-first_column // along), (first_column + columns - 1) // along + 1):
            row, column = i * down - first_row, j * along - first_column
            cell, last = lattice.cells[i % high, j % wide], lattice.heights[i % high, j % wide]
            if cell[0] != i or cell[1] != j:
                cell[0], cell[1] = i, j
                last[:] = math.nan
                lattice.steps[i % high, j % wide] = 0.0
            left = change_at(last, 0, height_at(heights, z, row, column - 1))
            step = change_at(last, 1, height_at(heights, z, row, column))
            right = change_at(last, 2, height_at(heights, z, row, column + 1))
            if not math.isnan(step):
                sizes[known] = abs(step)
                known += 1
            if abs(step) >= least:
                last_step = lattice.steps[i % high, j % wide]
                changed += last_step != 0.0
                reverses += step * last_step < 0.0
                lattice.steps[i % high, j % wide] = step
            if abs(step - left) >= least and abs(right - step) >= least:
                tilted += 1
                agreeing += (step - left) * (right - step) > 0.0
                tilt += abs(step - left)
    counts = Counts(
        fading * before.known + known, fading * before.changed + changed, fading * before.reversed + reverses,
        fading * before.tilted + tilted, fading * before.agreeing + agreeing, fading * before.tilt + tilt,
    )  # fmt: skip
    return counts, np.median(sizes[:known]) if known > 0 else 0.0


@compiled
def change_at(last: FloatArray, index: int, height: float) -> float:
    """Return the change of a stored height to a new one [m], and store the new one."""
    change: float = height - last[index]
    last[index] = height
    return change
