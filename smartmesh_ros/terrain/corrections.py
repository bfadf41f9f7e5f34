"""Corrections of a map of static ground: the fused estimate of its heights, which the shown heights approach.

Repeated measurements are fused by a Kalman filter with one state per sample: its height and the height's variance.
Between measurements the variance grows, so older measurements lose weight. A measurement outside the gate cannot be
explained by noise: the ground was changed or the map moved, so the filter of that sample restarts.

Measurements are assumed to be independent. Maps of a mapper that already fuses measurements are correlated, so the
variance is underestimated; ``growth`` bounds the error.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.checked_heights import dense
from smartmesh_ros.terrain.grid import overlap
from smartmesh_ros.terrain.motion import BLOCK

FloatGrid = NDArray[np.float32]


# Variance added to every height per second [m^2/s]. Raising it shortens the memory: with measurements of variance R
# every T seconds, about the last ``sqrt(R T / GROWTH)`` seconds count, 3 s for maps at 10 Hz with 10 mm noise. At zero
# all measurements count for ever.
GROWTH = 1e-6
# Innovation beyond which a sample restarts from the measurement [standard deviations]. Raising it causes fewer
# restarts: at 5, noise restarts one sample in two million; at infinity, none.
GATE = 5.0


def fuse(
    known: tuple[FloatGrid, FloatGrid],
    measured: FloatGrid,
    variance: float | FloatGrid,
    elapsed: float,
    first: tuple[int, int] = (0, 0),
    *,
    growth: float = GROWTH,
    gate: float = GATE,
) -> None:
    """Update ``known`` in place with heights of the whole map, or of the rectangle whose first sample is ``first``.

    ``known``: state of the filter, heights [m], NaN = not measured yet, and their variances [m^2]; both are (rows,
    columns), float32 and contiguous.
    ``measured``: heights (h, w) [m]; NaN = not seen, which keeps the height and raises its variance.
    ``variance``: variances of the heights [m^2], one number or (h, w). At zero the measured height replaces the old one
    exactly; heights with a negative or non-finite variance are ignored. ``elapsed``: time since these samples were last
    fused [s]. ``growth`` and ``gate`` are `GROWTH` and `GATE`. Raises `ValueError` if shapes do not match, and changes
    nothing.
    """
    seen = dense(measured)
    noises = dense(variance) if isinstance(variance, np.ndarray) else np.full((1, 1), variance, np.float32)
    CORE.fuse(*known, first, seen, noises, growth * elapsed, min(gate, 1e18) ** 2)


def fuse_rectangle(
    core: Any, first: tuple[int, int], new: FloatGrid, variance: float | FloatGrid, time: float, clocks: Any
) -> FloatGrid:
    """Return the estimate of a rectangle of a map of the core after its ``new`` heights (h, w) [m] of ``time`` [s];
    exact heights are returned unchanged."""
    if core.fused is None:
        if isinstance(variance, float) and variance == 0.0:
            return new
        core.begin_fusion()
    (row, column), (high, wide) = first, new.shape
    rows = slice(row // BLOCK, (row + high - 1) // BLOCK + 1)
    columns = slice(column // BLOCK, (column + wide - 1) // BLOCK + 1)
    before = float(clocks["time"][rows, columns].min())
    elapsed = max(time - before, 0.0) if math.isfinite(before) else 0.0
    fuse(core.fused, new, variance, elapsed, first)
    heights: FloatGrid = core.fused[0]
    return heights[row : row + high, column : column + wide]


def fuse_across(core: Any, before: Any, cells: tuple[int, int], elapsed: float) -> None:
    """Fuse the estimate of a map of the core with that of the map ``before``, which lies ``cells`` (rows, columns) back
    and is ``elapsed`` [s] older."""
    if core.fused is None or before.fused is None:
        return
    heights, variances = core.fused
    measured, noises = heights.copy(), variances.copy()
    heights[...], variances[...] = np.nan, 0.0
    new, old = overlap(cells, heights.shape)
    heights[new], variances[new] = (layer[old] for layer in before.fused)
    fuse(core.fused, measured, noises, elapsed)
