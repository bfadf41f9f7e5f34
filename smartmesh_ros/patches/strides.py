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
RINGS = (1, 2, 3, 4, 6, 8, 12, 16)


class _Interpolation(NamedTuple):
    """Three samples (3, K) of a window of K samples, by index, and their weights (3, K), for every sample."""

    corners: IntArray
    weights: FloatArray


@lru_cache
def _interpolation(rings: int, stride: int) -> _Interpolation:
    """Of which samples a strided patch is made at every sample of the window it covers."""
    reach, size = rings * stride, 2 * rings * stride + 1
    fine = np.stack(np.meshgrid(np.arange(size), np.arange(size), indexing="ij"), axis=-1).reshape(-1, 2) - reach
    points = triangles.locate(fine / stride + rings, 2 * rings + 1, 2 * rings + 1)
    corners = points.rows * stride * size + points.columns * stride
    return _Interpolation(corners.T.copy(), points.weights.T.copy())


def stride_deviation(window: Window, rows: IntArray, rings: int, stride: int) -> FloatArray:
    """How far a patch of ``rings`` and ``stride`` lies from the mesh at most, for the windows in ``rows`` (m,) [m].

    Infinite where samples are left out beside a hole. Both surfaces are linear on every facet of the finer one - the
    coarse diagonals run along the fine ones - so they differ most at a sample.
    """
    if stride == 1:
        return np.zeros(len(rows))
    corners, weights = _interpolation(rings, stride)
    covered = window.inner(rows, rings * stride)
    heights = covered.stacked.reshape(len(rows) * window.instants, -1)
    difference = -heights
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
    tolerance, so that no body changes back and forth, and is one size smaller at most where it leaves samples out.
    Where none will do, the finest there is; its deviation says so.
    """
    result = Extents(np.zeros_like(need), np.ones_like(need), np.full(len(need), np.inf))
    open_ = np.ones(len(need), bool)
    for count, next_count in zip(RINGS, [*RINGS[1:], np.inf], strict=True):
        steps = -(-need // count)
        tried = open_ & ((next_count >= rings) | (steps == 1))
        for step in np.unique(steps[tried]).tolist():
            if count * step > window.rings:
                continue
            rows = np.flatnonzero(tried & (steps == step))
            deviation = stride_deviation(window, bodies[rows], count, step)
            result.rings[rows], result.stride[rows], result.deviation[rows] = count, step, deviation
            cheaper = (count < rings[rows]) | ((count == rings[rows]) & (step > stride[rows]))
            open_[rows] = deviation > np.where(cheaper, HYSTERESIS * tolerance, tolerance)
    return result
