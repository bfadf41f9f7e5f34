"""Corrections of ground that stands still: what is shown, how fast, and what is known.

Heights fused over time, by closed forms and against what noise does.
"""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from smartmesh_ros import HeightMap, MotionConfig, Terrain
from smartmesh_ros.terrain.corrections import fuse

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
        heights = 0.1 * (columns + x) + 0.2 * (rows + y)
        motion = MotionConfig(changes="correction", settle=SETTLE)
        return HeightMap(heights, resolution=1.0, origin=(x, y), motion=motion)

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
    terrain = Terrain(HeightMap(np.zeros((SIZE, SIZE)), resolution=1.0, motion=motion))
    moved = np.full((SIZE, SIZE), 0.01)
    terrain.put("", HeightMap(moved, resolution=1.0, origin=(2.0, -3.0), time=1e-6, motion=motion))
    heights = terrain.at([[10.0, 10.0], [70.9, 10.0], [10.0, -2.0]], 0.0).heights
    np.testing.assert_allclose(heights, [0.005, 0.01, 0.01], atol=1e-4)


# Samples before and as they are measured, and the samples after, in float32: height [m] and variance [m^2].
FUSED = {
    "a mean": ((0.0, 3.0), (1.0, 4.0), (0.5, 2.0)),
    "a mean by certainty": ((8.0, 2.0), (4.0, 1.0), (5.0, 0.75)),
    "just within the gate": ((0.0, 3.0), (5.65, 4.0), (2.825, 2.0)),
    "just beyond it": ((0.0, 3.0), (5.66, 4.0), (5.66, 4.0)),
    "without noise": ((3.7, 3.0), (0.1, 0.0), (0.1, 0.0)),
    "of a hole": ((math.nan, 3.0), (1.0, 4.0), (1.0, 4.0)),
    "not seen": ((1.0, 3.0), (math.nan, 4.0), (1.0, 4.0)),
    **{f"of noise {noise}": ((1.0, 3.0), (2.0, noise), (1.0, 4.0)) for noise in (math.nan, math.inf, -1.0)},
}


def test_each_sample_of_a_region_is_fused_by_its_certainty_which_fades_and_no_other_changes() -> None:
    """With a gate of two deviations, and a square metre of variance more since the measurement before."""
    before, seen, after = np.array([*FUSED.values()], np.float32).transpose(1, 2, 0)
    known = np.pad(before[0][None], 2, constant_values=7.0), np.pad(before[1][None], 2, constant_values=7.0)
    fuse(known, seen[0][None], seen[1][None], 2.0, (2, 2), growth=0.5, gate=2.0)
    for layer, expected in zip(known, after, strict=True):
        np.testing.assert_allclose(layer[2, 2:-2], expected, rtol=1e-6)
        assert layer[2, 2 + [*FUSED].index("without noise")] == expected[[*FUSED].index("without noise")]
        layer[2, 2:-2] = 7.0
        assert (layer == 7.0).all()
    certain = np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32)
    fuse(certain, np.ones((1, 1), np.float32), 1.0, 0.0)
    assert certain == (0.0, 0.0)
