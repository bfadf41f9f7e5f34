"""Decimates a grid of samples: every sample near the bodies, fewer with growing distance, without cracks.

Square cells of 2^k samples are split while a body is near relative to their size. If a smaller cell has a corner in the
middle of a larger cell's edge, the larger cell becomes a fan of triangles around its centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class DecimationConfig:
    """``far_cells``: maximum number of cells of a map without bodies; at the default some four pixels each on a screen.
    ``most_cells``: maximum number of all cells. Beyond it the undecimated area around each body is reduced. The default
    is what a browser redraws ten times a second."""

    far_cells: int = 16_000
    most_cells: int = 60_000


class Surface(NamedTuple):
    """``rows`` and ``columns`` (V,): the samples that are vertices. ``triangles`` (T, 3): counter-clockwise where rows
    run along y and columns along x."""

    rows: IntArray
    columns: IntArray
    triangles: IntArray


class _Cells(NamedTuple):
    """Cells (n,) of ``size`` samples, by their first row and column."""

    size: int
    rows: IntArray
    columns: IntArray


def decimate(
    shape: tuple[int, int],
    centres: NDArray[np.float64],
    near: NDArray[np.float64],
    config: DecimationConfig = DecimationConfig(),
) -> Surface:
    """Return the surface of a map of ``shape`` (rows, columns), each >= 2.

    ``centres`` (B, 2): row and column of each body [samples], also outside the map. ``near`` (B,) [samples]: every
    sample within this distance of the body along rows and columns is a vertex. ``near`` is halved until the surface has
    at most ``config.most_cells`` cells.
    """
    level = coarsest_level(shape, config.far_cells)
    while True:
        leaves = _leaves(shape, level, centres, near)
        if sum(len(cells.rows) for cells in leaves) <= config.most_cells or not near.size or near.max() < 1.0:
            return _triangulate(shape, leaves)
        near = 0.5 * near


def coarsest_level(shape: tuple[int, int], far_cells: int) -> int:
    """Return the smallest k for which the map has at most ``far_cells`` cells of 2^k samples; 0 = no decimation."""
    level = 0
    while np.prod([-(-(count - 1) // (1 << level)) for count in shape]) > far_cells:
        level += 1
    return level


def _leaves(
    shape: tuple[int, int], coarsest: int, centres: NDArray[np.float64], near: NDArray[np.float64]
) -> list[_Cells]:
    """Return cells that cover the map; neighbours have half, the same or twice the size."""
    leaves = []
    split = np.ones(tuple(-(-(count - 1) // (2 << coarsest)) for count in shape), np.bool_)
    for level in range(coarsest, -1, -1):
        size = 1 << level
        cells = tuple(-(-(count - 1) // size) for count in shape)
        there = np.repeat(np.repeat(split, 2, axis=0), 2, axis=1)[: cells[0], : cells[1]]
        # Cells of twice the size are split at twice the distance, so that neighbours differ by at most one split.
        split = _within(cells, size, centres, near + size) if level else np.zeros(cells, np.bool_)
        rows, columns = np.nonzero(there & ~split)
        leaves.append(_Cells(size, rows * size, columns * size))
    return leaves


def _within(
    cells: tuple[int, ...], size: int, centres: NDArray[np.float64], distance: NDArray[np.float64]
) -> BoolArray:
    """Return a mask of the cells that are within a body's ``distance`` (B,) along rows and columns."""
    found = np.zeros(cells, np.bool_)
    reach = distance[:, None]
    first = np.maximum(np.floor((centres - reach) / size), 0).astype(np.int64)
    last = np.maximum(np.ceil((centres + reach) / size), 0).astype(np.int64)
    for (row, column), (row_end, column_end) in zip(first.tolist(), last.tolist(), strict=True):
        found[row:row_end, column:column_end] = True
    return found


def _triangulate(shape: tuple[int, int], leaves: list[_Cells]) -> Surface:
    """Return triangles between the corners of the cells, clipped at the last row and column."""
    width = shape[1] + 2 * max(cells.size for cells in leaves) + 1
    corners = [_corners(cells, width) for cells in leaves]
    known = np.unique(np.concatenate([of_cells.ravel() for of_cells in corners]))
    triangles = np.concatenate(
        [_cut(cells, of_cells, width, known) for cells, of_cells in zip(leaves, corners, strict=True)]
    )
    rows, columns = np.divmod(triangles, width)
    rows, columns = np.minimum(rows, shape[0] - 1), np.minimum(columns, shape[1] - 1)
    (r0, r1, r2), (c0, c1, c2) = rows.T, columns.T
    has_area = (c1 - c0) * (r2 - r0) != (c2 - c0) * (r1 - r0)
    samples, triangles = np.unique((rows * shape[1] + columns)[has_area], return_inverse=True)
    rows, columns = np.divmod(samples, shape[1])
    return Surface(rows, columns, triangles.reshape(-1, 3))


def _corners(cells: _Cells, width: int) -> IntArray:
    """Return the corners (n, 4) of cells, counter-clockwise, each as row * width + column."""
    first = cells.rows * width + cells.columns
    return np.asarray(first[:, None] + np.array([0, cells.size, cells.size * (width + 1), cells.size * width]))


def _cut(cells: _Cells, corners: IntArray, width: int, known: IntArray) -> IntArray:
    """Return triangles (m, 3) of cells: two each, or a fan around the centre if an edge has a vertex in its middle."""
    if cells.size == 1:
        return _halves(corners)
    ends = np.roll(corners, -1, axis=1)
    middles = (corners + ends) // 2
    place = np.minimum(np.searchsorted(known, middles), len(known) - 1)
    broken = known[place] == middles
    fans = broken.any(axis=1)
    centres = np.repeat((corners[fans, 0] + cells.size // 2 * (width + 1))[:, None], 4, axis=1)
    starts, ends, middles, broken = corners[fans], ends[fans], middles[fans], broken[fans]
    return np.concatenate(
        [
            _halves(corners[~fans]),
            np.stack([centres, starts, np.where(broken, middles, ends)], axis=-1).reshape(-1, 3),
            np.stack([centres[broken], middles[broken], ends[broken]], axis=-1),
        ]
    )


def _halves(corners: IntArray) -> IntArray:
    """Return two triangles of each cell, divided by the same diagonal as in the node."""
    return np.asarray(corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3))
