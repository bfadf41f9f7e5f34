"""Corrections of a map of static ground: the fused estimate of its heights, which the shown heights approach.

Repeated measurements are fused by a Kalman filter with one state per sample: its height and the height's variance.
Between measurements the variance grows, so older measurements lose weight. A measurement outside the gate cannot be
explained by noise: the ground was changed or the map moved, so the filter of that sample restarts.

Measurements are assumed to be independent. Maps of a mapper that already fuses measurements are correlated, so the
variance is underestimated; ``growth`` bounds the error.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.checked_heights import dense
from smartmesh_ros.terrain.grid import overlap
from smartmesh_ros.terrain.motion import BLOCK
from smartmesh_ros.terrain.state_file import filled

FloatGrid = NDArray[np.float32]


# Variance added to every height per second [m^2/s]. Raising it shortens the memory: with measurements of variance R
# every T seconds, about the last ``sqrt(R T / GROWTH)`` seconds count, 3 s for maps at 10 Hz with 10 mm noise. At zero
# all measurements count for ever.
GROWTH = 1e-6
# Innovation beyond which a sample restarts from the measurement [standard deviations]. Raising it causes fewer
# restarts: at 5, noise restarts one sample in two million; at infinity, none.
GATE = 5.0


class FusedMap(NamedTuple):
    """State of the filter: ``heights`` [m], NaN = not measured yet, and their ``variances`` [m^2].

    Both are (rows, columns), float32 and contiguous. `fuse` changes them in place.
    """

    heights: FloatGrid
    variances: FloatGrid


def nothing_known(rows: int, columns: int) -> FusedMap:
    """Return the state before the first measurement."""
    return FusedMap(np.full((rows, columns), np.nan, np.float32), np.zeros((rows, columns), np.float32))


def fuse(
    known: FusedMap,
    measured: FloatGrid,
    variance: float | FloatGrid,
    elapsed: float,
    first: tuple[int, int] = (0, 0),
    *,
    growth: float = GROWTH,
    gate: float = GATE,
) -> None:
    """Update ``known`` in place with heights of the whole map, or of the rectangle whose first sample is ``first``.

    ``measured``: heights (h, w) [m]; NaN = not seen, which keeps the height and raises its variance.
    ``variance``: variances of the heights [m^2], one number or (h, w). At zero the measured height replaces the old one
    exactly; heights with a negative or non-finite variance are ignored. ``elapsed``: time since these samples were last
    fused [s]. ``growth`` and ``gate`` are `GROWTH` and `GATE`. Raises `ValueError` if shapes do not match, and changes
    nothing.
    """
    seen = dense(measured)
    noises = dense(variance) if isinstance(variance, np.ndarray) else np.full((1, 1), variance, np.float32)
    CORE.fuse(known.heights, known.variances, first, seen, noises, growth * elapsed, min(gate, 1e18) ** 2)


class Corrections:
    """The corrections of one map, which is the ``core``'s.

    ``offsets``: old minus new heights (rows, columns) [m].
    """

    def __init__(self, core: Any) -> None:
        self._core = core
        self.offsets: FloatGrid = core.offsets

    @property
    def shown(self) -> float:
        """Instant up to which corrections are blended in [s], infinity before the first."""
        return float(self._core.shown)

    @property
    def fused(self) -> FusedMap | None:
        """The estimate; None if heights are not fused."""
        return None if self._core.fused is None else FusedMap(*self._core.fused)

    def put(self, known: FusedMap) -> None:
        """Replace the estimate."""
        if self._core.fused is None:
            self._core.begin_fusion()
        for array, new in zip(self._core.fused, known, strict=True):
            filled(array, new)

    @property
    def blending(self) -> bool:
        """True while corrections are being blended in."""
        return self.shown < float(self._core.settled)

    def show(self, time: float) -> None:
        """Blend corrections in up to ``time`` [s]; earlier times than before have no effect."""
        self._core.show(time if self.shown == math.inf else max(self.shown, time))

    def shift_time(self, by: float) -> None:
        """Add ``by`` [s] to all times."""
        self._core.show(self.shown + by)
        self._core.settled += by

    def fuse(
        self, first: tuple[int, int], new: NDArray[np.float32], variance: float | NDArray[np.float32], time: float,
        clocks: Any,
    ) -> NDArray[np.float32]:  # fmt: skip
        """Return the estimate of a rectangle after its ``new`` heights (h, w) [m] of ``time`` [s]; exact heights are
        returned unchanged."""
        if self.fused is None:
            if isinstance(variance, float) and variance == 0.0:
                return new
            self._core.begin_fusion()
        fused: Any = self.fused
        (row, column), (high, wide) = first, new.shape
        rows = slice(row // BLOCK, (row + high - 1) // BLOCK + 1)
        columns = slice(column // BLOCK, (column + wide - 1) // BLOCK + 1)
        before = float(clocks["time"][rows, columns].min())
        elapsed = max(time - before, 0.0) if math.isfinite(before) else 0.0
        fuse(fused, new, variance, elapsed, first)
        known: FloatGrid = fused.heights[row : row + high, column : column + wide]
        return known

    def fuse_across(self, before: Corrections, cells: tuple[int, int], elapsed: float) -> None:
        """Fuse with the estimate of the map ``before``, which lies ``cells`` (rows, columns) back and is ``elapsed``
        [s] older."""
        if self.fused is None or before.fused is None:
            return
        known, measured = nothing_known(*self.offsets.shape), self.fused
        new, old = overlap(cells, self.offsets.shape)
        known.heights[new], known.variances[new] = before.fused.heights[old], before.fused.variances[old]
        fuse(known, measured.heights, measured.variances, elapsed)
        self.put(known)
