"""Corrections of ground that stands still: what is shown, how fast, and what is known.

Heights fused over time, against the filter in double precision and against what noise does.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from smartmesh_ros import GridGeometry, HeightMap, MotionConfig, Terrain
from smartmesh_ros.terrain.corrections import FusedMap, fuse

SETTLE = 0.2
SIZE = 70  # more than a block
RNG = np.random.default_rng(3)


def corrected(heights: NDArray[np.float64], **motion: float) -> HeightMap:
    """A map that somebody looks at since time zero."""
    motion_of = MotionConfig(changes="correction", settle=SETTLE, **motion)
    heightmap = HeightMap(heights, resolution=1.0, motion=motion_of)
    heightmap.show(0.0)
    return heightmap


def shown(heightmap: HeightMap) -> NDArray[np.float64]:
    samples = heightmap.sample(np.arange(heightmap.size).reshape(heightmap.heights.shape), heightmap.time)
    assert not samples.velocities.any(), "ground that stands still has no velocity"
    return samples.heights


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0, 3.0])
def test_what_is_shown_goes_from_old_to_new_in_a_straight_line(share: float) -> None:
    old, new = RNG.normal(size=(2, SIZE, SIZE))
    heightmap = corrected(old)
    heightmap.replace(new, time=0.05)
    heightmap.show(share * SETTLE)
    part = min(share, 1.0)
    np.testing.assert_allclose(shown(heightmap), (1.0 - part) * old + part * new, atol=1e-6)
    assert heightmap.moving(0.0) == (share < 1.0)


def test_a_correction_while_one_is_worked_off_starts_from_what_is_shown() -> None:
    old, new, newer = RNG.normal(size=(3, SIZE, SIZE))
    heightmap = corrected(old)
    heightmap.replace(new, time=0.0)
    heightmap.show(0.3 * SETTLE)
    before = shown(heightmap)
    heightmap.update_region(0, 0, newer[:9, :9], time=0.06)
    np.testing.assert_allclose(shown(heightmap), before, atol=1e-6)
    heightmap.show(2.0 * SETTLE)
    expected = new.copy()
    expected[:9, :9] = newer[:9, :9]
    np.testing.assert_allclose(shown(heightmap), expected, atol=1e-6)


def test_what_is_shown_begins_when_somebody_looks_never_goes_back_and_moves_with_the_clock() -> None:
    motion = MotionConfig(changes="correction", settle=SETTLE)
    heightmap = HeightMap(np.full((SIZE, SIZE), 9.0), resolution=1.0, motion=motion)
    heightmap.replace(np.zeros((SIZE, SIZE)), time=0.0)
    assert (shown(heightmap) == 0.0).all()
    heightmap.show(0.0)
    heightmap.replace(np.ones((SIZE, SIZE)), time=0.0)
    heightmap.show(0.5 * SETTLE)
    heightmap.show(0.1 * SETTLE)
    heightmap.shift_time(-7.0)
    np.testing.assert_allclose(shown(heightmap), 0.5, atol=1e-6)


def test_holes_open_and_fill_and_filled_ones_go_with_what_is_beside_them() -> None:
    old = np.zeros((SIZE, SIZE))
    old[5, 5] = np.nan
    new = np.full((SIZE, SIZE), 1.0)
    new[7, 7] = np.nan
    heightmap = corrected(old)
    heightmap.replace(new, time=0.0)
    now = shown(heightmap)
    assert np.isnan(now[7, 7])
    assert now[5, 5] == 0.0
    heightmap.show(SETTLE)
    assert shown(heightmap)[5, 5] == 1.0


@pytest.mark.parametrize("step", [(0.0, 3.0), (0.0, 0.4)])
def test_a_map_that_came_elsewhere_corrects_the_one_before_it(step: tuple[float, float]) -> None:
    """By whole cells or not: where both have ground, what is shown stays."""

    def ground(x: float, y: float) -> HeightMap:
        rows, columns = np.mgrid[:SIZE, :SIZE]
        geometry = GridGeometry(rows=SIZE, columns=SIZE, resolution=1.0, origin=(x, y, 0.0))
        heights = 0.1 * (columns + x) + 0.2 * (rows + y)
        return HeightMap(heights, geometry=geometry, motion=MotionConfig(changes="correction", settle=SETTLE))

    terrain = Terrain(ground(0.0, 0.0))
    first = terrain.tiles[""]
    first.show(0.0)
    points = np.array([[10.0, 20.0], [33.3, 44.4]])
    before = terrain.at(points, 0.0).heights
    moved = ground(*step)
    moved.replace(moved.heights + 1.0, time=0.0)
    terrain.put("", moved)
    np.testing.assert_allclose(terrain.at(points, 0.1).heights, before, atol=1e-5)
    assert not terrain.at(points, 0.1).velocities.any()
    moved.show(SETTLE)
    np.testing.assert_allclose(terrain.at(points, 0.1).heights, before + 1.0, atol=1e-5)
    assert moved.track.motion[:2] == (0.0, 0.0)


@pytest.mark.parametrize("layer", [False, True])
def test_noise_is_fused_over_time_whole_and_in_regions_and_a_true_change_is_taken_at_once(layer: bool) -> None:
    sigma, count = 0.01, 50
    heightmap = corrected(RNG.normal(0.0, sigma, (SIZE, SIZE)), noise=0.0 if layer else sigma)
    variance = np.full((SIZE, SIZE), sigma**2) if layer else None
    for index in range(1, count):
        new = RNG.normal(0.0, sigma, (SIZE, SIZE))
        if index % 2:
            heightmap.replace(new, time=0.001 * index, variance=variance)
        else:
            part = None if variance is None else variance[:32]
            heightmap.update_region(0, 0, new[:32], time=0.001 * index, variance=part)
    assert heightmap.heights[:32].std() < 2.0 * sigma / math.sqrt(count)
    assert heightmap.heights[32:].std() < 2.0 * sigma / math.sqrt(0.5 * count)
    heights, known = RNG.normal(0.0, sigma, (SIZE, SIZE)), heightmap.heights.copy()
    heights[20:30] += 12.0 * sigma
    heights[30:40] -= 0.3
    heightmap.replace(heights, time=0.1, variance=variance)
    np.testing.assert_array_equal(heightmap.heights[20:40], heights[20:40].astype(np.float32))
    assert np.abs(heightmap.heights - known)[:20].max() < 0.5 * sigma


def test_what_is_fused_scrolls_with_the_map() -> None:
    motion = MotionConfig(changes="correction", noise=0.01)
    geometry = GridGeometry(rows=SIZE, columns=SIZE, resolution=1.0)
    terrain = Terrain(HeightMap(np.zeros((SIZE, SIZE)), geometry=geometry, motion=motion))
    moved = GridGeometry(rows=SIZE, columns=SIZE, resolution=1.0, origin=(2.0, -3.0, 0.0))
    terrain.put("", HeightMap(np.full((SIZE, SIZE), 0.01), geometry=moved, time=1e-6, motion=motion))
    heights = terrain.at([[10.0, 10.0], [70.9, 10.0], [10.0, -2.0]], 0.0).heights
    np.testing.assert_allclose(heights, [0.005, 0.01, 0.01], atol=1e-4)


SHAPE = (5, 7)
Grid = NDArray[np.float32]
HEIGHTS = st.floats(-1e3, 1e3, width=32) | st.just(math.nan)
VARIANCES = st.floats(0.0, 10.0, width=32)
NOISES = VARIANCES | st.sampled_from([math.nan, math.inf, -1.0])


def grid(values: st.SearchStrategy[float]) -> st.SearchStrategy[Grid]:
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
    heights=grid(HEIGHTS), variances=grid(VARIANCES), measured=grid(HEIGHTS), noises=grid(NOISES),
    row=st.integers(0, 2), column=st.integers(0, 3), elapsed=st.floats(0.0, 100.0), growth=st.floats(0.0, 0.1),
    gate=st.floats(0.1, 20.0) | st.just(math.inf),
)  # fmt: skip
def test_every_sample_of_a_region_is_the_filter_in_double_precision_and_no_other_changes(
    heights: Grid, variances: Grid, measured: Grid, noises: Grid, row: int, column: int, elapsed: float, growth: float,
    gate: float,
) -> None:  # fmt: skip
    """What is measured without noise is taken bit for bit."""
    known = FusedMap(heights.copy(), variances.copy())
    region = (slice(row, row + 3), slice(column, column + 4))
    fuse(known, measured[region], noises[region], elapsed, (row, column), growth=growth, gate=gate)
    for place in np.ndindex(SHAPE):
        before, noise, z = float(heights[place]), float(noises[place]), float(measured[place])
        if not (row <= place[0] < row + 3 and column <= place[1] < column + 4):
            np.testing.assert_array_equal([array[place] for array in known], [heights[place], variances[place]])
            continue
        prior = float(variances[place]) + growth * elapsed
        if 0.0 < noise < math.inf and at_the_gate(before, prior, z, noise, gate):
            continue
        height, variance = by_information(before, float(variances[place]), z, noise, growth * elapsed, gate)
        reach = 0.0 if math.isnan(before + z) or noise == 0.0 else abs(before) + abs(z)
        exact = 0.0 if noise == 0.0 and not math.isnan(z) else 1e-6
        assert known.heights[place] == pytest.approx(height, rel=exact, abs=1e-6 * reach, nan_ok=True)
        assert known.variances[place] == pytest.approx(variance, rel=1e-5, abs=1e-37)
