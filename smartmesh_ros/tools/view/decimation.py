"""Decimates a grid of samples: every sample near the bodies, fewer with growing distance, without cracks.

Square cells of 2^k samples are split while a body is near relative to their size. If a smaller cell has a corner in the
middle of a larger cell's edge, the larger cell becomes a fan of triangles around its centre.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Most cells of a map without bodies: some four pixels each on a screen.
FAR_CELLS = 16_000
# Most of all cells, which a browser redraws ten times a second; with more the whole area around each body shrinks.
MOST_CELLS = 60_000


class Surface(NamedTuple):
    """``rows`` and ``columns`` (V,): the samples that are vertices. ``triangles`` (T, 3): counter-clockwise where rows
    run along y and columns along x."""

    rows: IntArray
    columns: IntArray
    triangles: IntArray


def decimate(
    shape: tuple[int, int],
    centres: FloatArray,
    near: FloatArray,
    far_cells: int = FAR_CELLS,
    most_cells: int = MOST_CELLS,
) -> Surface:
    """Return the surface of a map of ``shape`` (rows, columns), each >= 2.

    ``centres`` (B, 2): row and column of each body [samples], also outside the map. ``near`` (B,) [samples]: every
    sample within this distance of the body along rows and columns is a vertex. ``near`` is halved until the surface has
    at most ``most_cells`` cells.
    """
    coarsest = 0
    while np.prod(_counts(shape, 1 << coarsest)) > far_cells:
        coarsest += 1
    while True:
        cells = _cells(shape, coarsest, centres, near)
        if sum(map(len, cells)) <= most_cells or not near.size or near.max() < 1.0:
            return _triangulate(shape, cells)
        near = 0.5 * near


def _counts(shape: tuple[int, int], size: int) -> tuple[int, ...]:
    return tuple(-(-(count - 1) // size) for count in shape)


def _cells(shape: tuple[int, int], coarsest: int, centres: FloatArray, near: FloatArray) -> list[IntArray]:
    """Return the first row and column (n, 2) of cells that cover the map, by level k, for cells of 2^k samples.
    Neighbours have half, the same or twice the size."""
    found: list[IntArray] = []
    # Whole samples: fractions would be rounded otherwise at another size.
    low, high = np.floor(centres - near[:, None]).astype(np.int64), np.ceil(centres + near[:, None]).astype(np.int64)
    split = np.ones(_counts(shape, 2 << coarsest), np.bool_)
    for level in range(coarsest, -1, -1):
        size = 1 << level
        counts = _counts(shape, size)
        there = split.repeat(2, axis=0).repeat(2, axis=1)[: counts[0], : counts[1]]
        # Cells of twice the size are split at twice the distance, so that neighbours differ by at most one split.
        first, last = np.maximum(low // size - 1, 0), np.maximum(-(-high // size) + 1, 0)
        split = np.zeros(counts, np.bool_)
        for (row, column), (row_end, column_end) in zip(first.tolist(), last.tolist() if level else (), strict=False):
            split[row:row_end, column:column_end] = True
        found.insert(0, np.argwhere(there & ~split) * size)
    return found


def _triangulate(shape: tuple[int, int], cells: list[IntArray]) -> Surface:
    """Return triangles between the corners of the cells, clipped at the last row and column."""
    width = shape[1] + (2 << len(cells))
    corners = []  # of each cell counter-clockwise, each as row * width + column
    for level, firsts in enumerate(cells):
        around = (1 << level) * np.array([0, 1, width + 1, width])
        corners.append((firsts @ (width, 1))[:, None] + around)
    known = np.unique(np.concatenate([of_level.ravel() for of_level in corners]))
    triangles = np.concatenate(
        [_cut(of_level, known) if level else _halves(of_level) for level, of_level in enumerate(corners)]
    )
    rows, columns = np.divmod(triangles, width)
    rows, columns = np.minimum(rows, shape[0] - 1), np.minimum(columns, shape[1] - 1)
    (r0, r1, r2), (c0, c1, c2) = rows.T, columns.T
    has_area = (c1 - c0) * (r2 - r0) != (c2 - c0) * (r1 - r0)
    samples, triangles = np.unique((rows * shape[1] + columns)[has_area], return_inverse=True)
    return Surface(*np.divmod(samples, shape[1]), triangles.reshape(-1, 3))


def _cut(corners: IntArray, known: IntArray) -> IntArray:
    """Return triangles (m, 3) of cells with ``corners`` (n, 4): two each, or a fan around the centre if an edge has one
    of the ``known`` vertices in its middle."""
    ends = np.roll(corners, -1, axis=1)
    middles = (corners + ends) // 2
    broken = np.isin(middles, known, kind="sort")
    fans = broken.any(axis=1)
    starts, ends, middles, broken = corners[fans], ends[fans], middles[fans], broken[fans]
    centres = np.repeat(((starts[:, 0] + starts[:, 2]) // 2)[:, None], 4, axis=1)
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
