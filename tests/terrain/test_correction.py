"""Corrections of ground that stands still: what is shown, how fast, and what is known."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from smartmesh_ros import GridGeometry, HeightMap, MotionConfig, Terrain

SETTLE = 0.2
SIZE = 70  # more than a block
RNG = np.random.default_rng(3)


def corrected(heights: NDArray[np.float64], **motion: float) -> HeightMap:
    """A map that somebody looks at since time zero."""
    heightmap = HeightMap(heights, motion=MotionConfig(changes="correction", settle=SETTLE, **motion))
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
    assert heightmap.corrections.blending == heightmap.moving(0.0) == (share < 1.0)


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


def test_a_map_that_nobody_has_looked_at_is_shown_at_once() -> None:
    heightmap = HeightMap(np.zeros((SIZE, SIZE)), motion=MotionConfig(changes="correction"))
    heightmap.replace(np.ones((SIZE, SIZE)), time=0.1)
    assert (shown(heightmap) == 1.0).all()


def test_what_is_shown_never_goes_back_and_moves_with_the_clock() -> None:
    heightmap = corrected(np.zeros((SIZE, SIZE)))
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
def test_noise_is_fused_over_time_whole_and_in_regions(layer: bool) -> None:
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


def test_zero_noise_takes_heights_as_they_are() -> None:
    heightmap = corrected(np.zeros((SIZE, SIZE)))
    new = RNG.normal(size=(SIZE, SIZE)).astype(np.float32)
    heightmap.replace(new, time=0.1)
    assert heightmap.corrections.fused is None
    assert np.array_equal(heightmap.heights, new)


def test_what_is_fused_scrolls_with_the_map() -> None:
    motion = MotionConfig(changes="correction", noise=0.01)
    geometry = GridGeometry(rows=SIZE, columns=SIZE, resolution=1.0)
    terrain = Terrain(HeightMap(np.zeros((SIZE, SIZE)), geometry=geometry, motion=motion))
    moved = GridGeometry(rows=SIZE, columns=SIZE, resolution=1.0, origin=(2.0, -3.0, 0.0))
    terrain.put("", HeightMap(np.full((SIZE, SIZE), 0.01), geometry=moved, time=1e-6, motion=motion))
    heights = terrain.at([[10.0, 10.0], [70.9, 10.0], [10.0, -2.0]], 0.0).heights
    np.testing.assert_allclose(heights, [0.005, 0.01, 0.01], atol=1e-4)
