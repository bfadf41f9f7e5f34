"""How far a patch that leaves samples out lies from the main mesh, and the cheapest that is near enough."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.grid_window import Window
from smartmesh_ros.terrain import triangles
from smartmesh_ros.terrain.grid import FloatArray, IntArray

# A cheaper patch than a body has must keep this share of the tolerance.
HYSTERESIS = 0.75
# Rings a patch may have, cheapest first. The cost of a collider follows its samples.
RINGS = (1, 2, 3, 4, 6, 8, 10, 12, 16)
# Strides from which on some of the samples tell where a look at all of them is in vain, if those are not few.
COARSE, MANY = 4, 1000
# Some patch of at least so many rings covers what is needed and lies in the window, whatever its size: these are never
# left out.
SURE = 10


class _Interpolation(NamedTuple):
    """K samples of a window, by index (K,), and for each the three it lies between on a patch (3, K) and their weights
    (3, K)."""

    samples: IntArray
    corners: IntArray
    weights: FloatArray


@lru_cache
def _interpolation(rings: int, stride: int, step: int) -> _Interpolation:
    """What a strided patch is made of at every ``step``-th sample, along each side, of the window it covers."""
    reach, size = rings * stride, 2 * rings * stride + 1
    places = np.arange(0, size, step)
    fine = np.stack(np.meshgrid(places, places, indexing="ij"), axis=-1).reshape(-1, 2)
    points = triangles.locate((fine - reach) / stride + rings, 2 * rings + 1, 2 * rings + 1)
    corners = points.rows * stride * size + points.columns * stride
    return _Interpolation(fine @ (size, 1), corners.T.copy(), points.weights.T.copy())


def stride_deviation(window: Window, rows: IntArray, rings: int, stride: int, step: int = 1) -> FloatArray:
    """How far a patch of ``rings`` and ``stride`` lies from the mesh at most, for the windows in ``rows`` (m,) [m]; by
    every ``step``-th sample only: at least.

    Infinite where samples are left out beside a hole. Both surfaces are linear on every facet of the finer one - the
    coarse diagonals run along the fine ones - so they differ most at a sample.
    """
    if stride == 1:
        return np.zeros(len(rows))
    samples, corners, weights = _interpolation(rings, stride, step)
    covered = window.inner(rows, rings * stride)
    heights = covered.stacked.reshape(len(rows) * window.instants, -1)
    difference = -heights if step == 1 else -heights[:, samples]
    for corner, weight in zip(corners, weights, strict=True):
        difference += heights[:, corner] * weight
    np.abs(difference, out=difference)
    if window.holes:
        difference[np.isnan(difference)] = np.inf
    return covered.worst(difference.max(axis=1))


class Extents(NamedTuple):
    """Sizes of n patches, shapes (n,): rings, stride, and how far they may lie from the mesh [m]."""

    rings: IntArray
    stride: IntArray
    deviation: FloatArray


def cheapest_extents(
    window: Window, bodies: IntArray, need: IntArray, tolerance: float, rings: IntArray, stride: IntArray
) -> Extents:
    """The patches with the fewest samples that cover ``need`` (n,) rings of the map within the tolerance [m], for n
    ``bodies`` of a window.

    ``rings``, ``stride`` (n,): what the bodies have now, 0 = nothing. A cheaper patch must keep a share of the
    tolerance, so that no body changes back and forth. Where none will do, the finest there is; its deviation says so.
    """
    result = Extents(np.zeros_like(need), np.ones_like(need), np.full(len(need), np.inf))
    open_ = np.ones(len(need), bool)
    for count in RINGS:
        steps = -(-need // count)
        for step in np.unique(steps[open_]).tolist():
            if count * step > window.rings:
                continue
            rows = np.flatnonzero(open_ & (steps == step))
            cheaper = (count < rings[rows]) | ((count == rings[rows]) & (step > stride[rows]))
            limit = np.where(cheaper, HYSTERESIS * tolerance, tolerance)
            if step >= COARSE and count < SURE and rows.size * (count * step) ** 2 > MANY:
                # Where the middles of its cells are too far away already, the rest need not be looked at.
                rough = stride_deviation(window, bodies[rows], count, step, step // 2)
                rows, limit = rows[rough <= limit], limit[rough <= limit]
            if rows.size:
                deviation = stride_deviation(window, bodies[rows], count, step)
                result.rings[rows], result.stride[rows], result.deviation[rows] = count, step, deviation
                open_[rows] = deviation > limit
    return result
