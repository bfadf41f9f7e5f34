"""Heights fused over time, against the filter in double precision and against what noise does."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from smartmesh_ros.terrain.corrections import FusedMap, FusionConfig, fuse, nothing_known

SHAPE = (5, 7)
HEIGHTS = st.floats(-1e3, 1e3, width=32) | st.just(math.nan)
VARIANCES = st.floats(0.0, 10.0, width=32)
NOISES = VARIANCES | st.sampled_from([math.nan, math.inf, -1.0])


def grid(values: st.SearchStrategy[float]) -> st.SearchStrategy[NDArray[np.float32]]:
    return arrays(np.float32, SHAPE, elements=values)


def by_information(
    height: float, variance: float, measured: float, noise: float, grown: float, gate: float
) -> tuple[float, float]:
    """One sample in double precision: the mean weighted by information, instead of a gain."""
    prior = variance + grown
    if math.isnan(measured) or not 0.0 <= noise < math.inf:
        return height, prior
    if math.isnan(height) or noise == 0.0 or abs(measured - height) > gate * math.sqrt(prior + noise):
        return measured, noise
    if prior == 0.0:
        return height, 0.0
    total = 1.0 / prior + 1.0 / noise
    return (height / prior + measured / noise) / total, 1.0 / total


def at_the_gate(height: float, prior: float, measured: float, noise: float, gate: float) -> bool:
    """Whether rounding decides if a sample starts anew."""
    limit = gate * math.sqrt(prior + noise)
    return abs(abs(measured - height) - limit) <= 1e-5 * (limit + abs(measured) + abs(height))


@given(
    heights=grid(HEIGHTS),
    variances=grid(VARIANCES),
    measured=grid(HEIGHTS),
    noises=grid(NOISES),
    elapsed=st.floats(0.0, 100.0),
    growth=st.floats(0.0, 0.1),
    gate=st.floats(0.1, 20.0) | st.just(math.inf),
)
def test_every_sample_is_the_filter_in_double_precision(
    heights: NDArray[np.float32],
    variances: NDArray[np.float32],
    measured: NDArray[np.float32],
    noises: NDArray[np.float32],
    elapsed: float,
    growth: float,
    gate: float,
) -> None:
    known = FusedMap(heights.copy(), variances.copy())
    fuse(known, measured, noises, elapsed, FusionConfig(growth=growth, gate=gate))
    for place in np.ndindex(SHAPE):
        before, noise, z = float(heights[place]), float(noises[place]), float(measured[place])
        prior = float(variances[place]) + growth * elapsed
        if 0.0 < noise < math.inf and at_the_gate(before, prior, z, noise, gate):
            continue
        height, variance = by_information(before, float(variances[place]), z, noise, growth * elapsed, gate)
        reach = 0.0 if math.isnan(before + z) else abs(before) + abs(z)
        assert known.heights[place] == pytest.approx(height, rel=1e-6, abs=1e-6 * reach, nan_ok=True)
        assert known.variances[place] == pytest.approx(variance, rel=1e-5, abs=1e-37)


@given(heights=grid(HEIGHTS), variances=grid(VARIANCES), measured=grid(HEIGHTS))
def test_without_noise_the_measurement_is_taken_bit_for_bit(
    heights: NDArray[np.float32], variances: NDArray[np.float32], measured: NDArray[np.float32]
) -> None:
    known = FusedMap(heights.copy(), variances.copy())
    fuse(known, measured, 0.0, 0.1, FusionConfig(gate=math.inf))
    expected = np.where(np.isnan(measured), heights, measured)
    np.testing.assert_array_equal(known.heights.view(np.uint32), expected.view(np.uint32))
    assert (known.variances[~np.isnan(measured)] == 0.0).all()


@given(
    row=st.integers(0, 8),
    column=st.integers(0, 8),
    size=st.tuples(st.integers(1, 4), st.integers(1, 4)),
    each=st.booleans(),
)
def test_a_region_is_fused_as_it_is_in_the_whole_map(row: int, column: int, size: tuple[int, int], each: bool) -> None:
    rng = np.random.default_rng(3)
    heights, variances = rng.normal(size=(12, 12)).astype(np.float32), rng.random((12, 12)).astype(np.float32)
    measured, noises = rng.normal(size=(12, 12)).astype(np.float32), rng.random((12, 12)).astype(np.float32)
    region = (slice(row, row + size[0]), slice(column, column + size[1]))
    whole, part = FusedMap(heights.copy(), variances.copy()), FusedMap(heights.copy(), variances.copy())
    noise = noises if each else 0.3
    fuse(whole, measured, noise, 0.5, FusionConfig(growth=0.1))
    fuse(part, measured[region], noises[region] if each else 0.3, 0.5, FusionConfig(growth=0.1), (row, column))
    for fused, alone, before in zip(whole, part, (heights, variances), strict=True):
        np.testing.assert_array_equal(alone[region], fused[region])
        outside = np.ones((12, 12), bool)
        outside[region] = False
        np.testing.assert_array_equal(alone[outside], before[outside])


@pytest.mark.parametrize("step", [0.05, -0.3])
def test_a_true_change_is_taken_at_once_and_noise_is_not(step: float) -> None:
    rng = np.random.default_rng(2)
    deviation = 0.005
    known = nothing_known(60, 60)
    for _ in range(30):
        fuse(known, rng.normal(0.0, deviation, (60, 60)).astype(np.float32), deviation**2, 0.1, FusionConfig())
    assert np.abs(known.heights).max() < 2.5 * deviation  # averaged: no sample was put anew
    dug = rng.normal(0.0, deviation, (60, 60)).astype(np.float32)
    dug[20:30] += np.float32(step)
    fuse(known, dug, deviation**2, 0.1, FusionConfig())
    np.testing.assert_array_equal(known.heights[20:30], dug[20:30])
    assert np.abs(known.heights[:20]).max() < 2.5 * deviation
