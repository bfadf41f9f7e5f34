"""Fusion of repeated height measurements of static ground: a Kalman filter with one state per sample.

The state of a sample is its height and the height's variance. Between measurements the variance grows, so older
measurements lose weight. A measurement outside the gate cannot be explained by noise: the ground was changed or the map
moved, so the filter of that sample restarts.

Measurements are assumed to be independent. Maps of a mapper that already fuses measurements are correlated, so the
variance is underestimated; ``growth`` bounds the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.grid import overlap

FloatGrid = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class FusionConfig:
    """Parameters of the filter.

    ``growth`` [m^2/s], at least zero: variance added to every height per second. Raising it shortens the memory: with
    measurements of variance R every T seconds, about the last ``sqrt(R T / growth)`` seconds count. The default gives
    3 s for maps at 10 Hz with 10 mm noise. At zero all measurements count for ever.
    ``gate`` [standard deviations], above zero: innovation beyond which a sample restarts from the measurement. Raising
    it causes fewer restarts: at 5, noise restarts one sample in two million; at infinity, none.
    """

    growth: float = 1e-6
    gate: float = 5.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.growth < math.inf:
            raise ValueError(f"growth is {self.growth} m^2/s; it must be a finite number of at least zero")
        if not self.gate > 0.0:
            raise ValueError(f"gate is {self.gate} standard deviations; it must be above zero")


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
    config: FusionConfig,
    first: tuple[int, int] = (0, 0),
) -> None:
    """Update ``known`` in place with heights of the whole map, or of the rectangle whose first sample is ``first``.

    ``measured``: heights (h, w) [m]; NaN = not seen, which keeps the height and raises its variance.
    ``variance``: variances of the heights [m^2], one number or (h, w). At zero the measured height replaces the old one
    exactly; heights with a negative or non-finite variance are ignored. ``elapsed``: time since these samples were last
    fused [s]. ``first``: (row, column). Raises `ValueError` if shapes do not match, and changes nothing.
    """
    _require_inside(known, measured.shape, first)
    if not 0.0 <= elapsed < math.inf:
        raise ValueError(f"{elapsed} s have passed since the last heights; the time must be finite and at least zero")
    seen = np.require(measured, np.float32, ("C", "A"))
    if not isinstance(variance, np.ndarray):
        noises = np.full((1, 1), variance, np.float32)
    elif variance.shape == seen.shape:
        noises = np.require(variance, np.float32, ("C", "A"))
    else:
        raise ValueError(f"variances have shape {variance.shape}; heights have {seen.shape}")
    CORE.fuse(known.heights, known.variances, first, seen, noises, config.growth * elapsed, min(config.gate, 1e18) ** 2)


def fused_across(before: FusedMap, measured: FusedMap, cells: tuple[int, int], elapsed: float) -> FusedMap:
    """Return the fused state of a ``measured`` map and the state ``before`` it, of the same size.

    The measured map lies ``cells`` (rows, columns) further on and is ``elapsed`` [s] newer.
    """
    known = nothing_known(*measured.heights.shape)
    (to_r, from_r), (to_c, from_c) = (overlap(by, size) for by, size in zip(cells, before.heights.shape, strict=True))
    known.heights[to_r, to_c] = before.heights[from_r, from_c]
    known.variances[to_r, to_c] = before.variances[from_r, from_c]
    fuse(known, measured.heights, measured.variances, elapsed, FusionConfig())
    return known


def _require_inside(known: FusedMap, shape: tuple[int, ...], first: tuple[int, int]) -> None:
    size = known.heights.shape
    for name, array in known._asdict().items():
        if len(size) != 2 or array.shape != size or array.dtype != np.float32 or not array.flags.c_contiguous:
            raise ValueError(f"{name} of a fused map must be a contiguous float32 array of (rows, columns)")
    rows, columns = size
    if len(shape) != 2 or min(first) < 0 or first[0] + shape[0] > rows or first[1] + shape[1] > columns:
        raise ValueError(f"heights of shape {shape} at {first} leave a map of {size}")
