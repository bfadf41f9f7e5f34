"""A hundred samples of a map that tell how it changed from the map before, at the same price for any map.

They stay in their places of the world while a map travels over the ground by whole cells, and move with a map that
slides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import FloatArray

FloatGrid = NDArray[np.float32]
# Samples of a place of the lattice: its own and those on either side of it in its row.
STENCIL = 3


class Lattice(NamedTuple):
    """Samples that are compared, (n, m) places in a ring: place (i, j) holds row and column ``cells`` (n, m, 2) of the
    world's lattice, the last ``heights`` there (n, m, STENCIL) [m], NaN = not known, and the last change of each place,
    ``steps`` (n, m) [m], zero = none yet. ``stride``: samples of the map from place to place, along rows and
    columns."""

    cells: NDArray[np.int64]
    heights: FloatArray
    steps: FloatArray
    stride: tuple[int, int]


class Counts(NamedTuple):
    """Sums over places: ``known`` now and in the map before; ``changed`` twice, ``reversed`` of these; ``tilted``
    between the samples on both sides, ``agreeing`` ones of these, and the sum of how much to one side, ``tilt`` [m]."""

    known: float
    changed: float
    reversed: float
    tilted: float
    agreeing: float
    tilt: float


NO_COUNTS = Counts(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def lattice_of(shape: tuple[int, ...], samples: int) -> Lattice:
    """A lattice for maps of so many rows and columns, which knows nothing yet."""
    rows, columns = (max(-(-size // samples), 1) for size in shape)
    places = (-(-shape[0] // rows) + 1, -(-shape[1] // columns) + 1)  # one more where the map lies between them
    return Lattice(
        np.zeros((*places, 2), np.int64), np.full((*places, STENCIL), math.nan), np.zeros(places), (rows, columns)
    )


@compiled
def height_at(heights: FloatGrid, z: float, row: int, column: int) -> float:
    """Height of a sample [m]; NaN beyond the edge."""
    rows, columns = heights.shape
    return z + float(heights[row, column]) if 0 <= row < rows and 0 <= column < columns else math.nan


@compiled
def moved_as_one(
    lattice: Lattice, heights: FloatGrid, z: float, first_row: int, first_column: int, least: float
) -> bool:
    """Whether all samples of a map rose by the same, within ``least`` [m], above those of the same indices in the map
    before: the ground was carried with the map."""
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
    """`Counts` of a map against the one before, whose sample (0, 0) is (``first_row``, ``first_column``) of the world's
    lattice, added to those ``before``, ``fading`` [-]; and by how much most of the ground changed, the median [m].
    Changes below ``least`` [m] are none."""
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
    """By how much a height changed to the one that takes its place [m]."""
    change: float = height - last[index]
    last[index] = height
    return change
