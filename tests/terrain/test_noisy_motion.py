"""Velocities of noisy ground count as far as they stand out of the noise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import KEPT, MotionConfig
from tests.examples import examples
from tests.terrain.motion_law import (
    HALF_WINDOW,
    SCATTER_MARGIN,
    agreed,
    block_phase,
    displacement,
    motion_of,
    rise_of,
)

SIDE = 70  # more than a block
INTERVAL = 0.05
AHEAD = 0.01


def told(maps: list[FloatArray], noise: float, interval: float = INTERVAL) -> HeightMap:
    heightmap = HeightMap(maps[0], time=0.0, motion=MotionConfig(noise=noise))
    for number, heights in enumerate(maps[1:], start=1):
        heightmap.replace(heights, time=number * interval)
    return heightmap


def sampled(heightmap: HeightMap, age: float = 0.0) -> tuple[FloatArray, FloatArray]:
    rows, columns = heightmap.geometry.rows, heightmap.geometry.columns
    found = heightmap.sample(np.arange(rows * columns), heightmap.time + age, AHEAD)
    return found.heights.reshape(rows, columns), found.velocities.reshape(rows, columns)


def standing_out(values: FloatArray, row: int, column: int, variance: float) -> float:
    """The estimate for one sample, written anew with arrays; ``values`` (R, C), NaN = not known."""
    padded = np.pad(values, HALF_WINDOW, constant_values=np.nan)
    window = padded[row : row + 2 * HALF_WINDOW + 1, column : column + 2 * HALF_WINDOW + 1].ravel()
    half = len(window) // 2
    opposite = 0.5 * (window[:half] + window[: -half - 1 : -1])
    opposite = opposite[~np.isnan(opposite)]
    own = window[half]
    n = 2 * len(opposite) + 1
    mean = (own + 2.0 * opposite.sum()) / n
    scatter = 2.0 * opposite.var(ddof=1) if len(opposite) > 1 else 0.0
    beyond = max(1.0 - SCATTER_MARGIN * variance / scatter, 0.0) if scatter > 0.0 else 0.0
    around = max(1.0 - variance / n / mean**2, 0.0) if mean != 0.0 else 0.0
    return float(around * mean + beyond * (own - mean))


@examples(20)
@given(
    st.integers(0, 10**6), st.floats(1e-4, 0.02), st.integers(0, 11), st.integers(0, 13), st.floats(0.0, 0.03),
    st.lists(st.tuples(st.integers(0, 11), st.integers(0, 13)), max_size=6),
)  # fmt: skip
def test_it_is_what_an_independent_form_says(
    seed: int, noise: float, row: int, column: int, age: float, holes: list[tuple[int, int]]
) -> None:
    rng = np.random.default_rng(seed)
    maps = [rng.normal(0.0, 0.01, (12, 14)) + 0.02 * number * number for number in range(4)]
    for hole in holes:
        maps[-1][hole] = np.nan
    heights, rates = sampled(told(maps, noise), age)
    if np.isnan(maps[-1][row, column]):
        assert np.isnan(heights[row, column])
        return
    h = [np.asarray(heights_rc, np.float32).astype(np.float64) for heights_rc in maps]
    v2, v1, v0 = ((later - earlier) / INTERVAL for earlier, later in pairwise(h))
    change, change_1 = (v0 - v1) / INTERVAL, (v1 - v2) / INTERVAL
    change_1[np.isnan(change)] = np.nan
    velocity = standing_out(v0, row, column, 2.0 * (noise / INTERVAL) ** 2)
    of_change = 6.0 * noise**2 / INTERVAL**4
    acceleration = agreed(standing_out(change, row, column, of_change), standing_out(change_1, row, column, of_change))
    middle = age + 0.5 * INTERVAL
    expected = h[3][row, column] + velocity * age + acceleration * 0.5 * age * (age + INTERVAL)
    assert heights[row, column] == pytest.approx(expected, abs=2e-5)
    mean_rate = velocity + acceleration * (middle + 0.5 * AHEAD)
    assert rates[row, column] == pytest.approx(mean_rate, abs=2e-3 + 1e-3 * abs(acceleration))


def test_without_noise_it_is_the_motion_of_each_sample_bit_for_bit() -> None:
    rng = np.random.default_rng(1)
    heightmap = told([rng.normal(0.0, 0.1, (SIDE, SIDE)) for _ in range(4)], 0.0)
    age = 0.02
    heights, rates = sampled(heightmap, age)
    last, kept, clocks, _ = heightmap.arrays
    time = heightmap.time + age
    for row, column in rng.integers(0, SIDE, (200, 2)).tolist():
        clock = clocks[row // 64, column // 64]
        phase = block_phase(clock, time, heightmap.motion.code)
        ring = [float(kept[(clock.newest - back) % KEPT, row, column]) for back in range(KEPT)]
        velocity, acceleration = motion_of(*ring, phase, 25.0)
        assert heights[row, column] == float(last[row, column]) + displacement(velocity, acceleration, phase)
        assert rates[row, column] == rise_of(velocity, acceleration, phase, AHEAD) / AHEAD


@pytest.mark.parametrize("rate", [5.0, 20.0, 60.0])
@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_ground_that_stands_still_hardly_moves(rate: float, noise: float) -> None:
    """A seventh of what it does where the noise is not told, also on a steep slope."""
    rng = np.random.default_rng(2)
    shape = np.add.outer(2.0 * np.arange(SIDE), np.arange(SIDE))
    maps = [shape + rng.normal(0.0, noise, shape.shape) for _ in range(4)]
    speeds = [np.sqrt(np.square(sampled(told(maps, said, 1.0 / rate))[1]).mean()) for said in (noise, 0.0)]
    assert speeds[1] > noise * rate
    assert speeds[0] < speeds[1] / 7.0


def waves(time: float, frequency: float) -> NDArray[np.float64]:
    x, y = np.meshgrid(0.25 * np.arange(SIDE), 0.25 * np.arange(SIDE))
    return np.asarray(0.3 * np.sin(np.hypot(x - 8.0, y - 8.0) + frequency * time))


@pytest.mark.parametrize("frequency", [1.0, 4.0])
@pytest.mark.parametrize("noise", [0.002, 0.005])
def test_waves_keep_their_velocity(frequency: float, noise: float) -> None:
    """Half of the noise of their velocity is gone, or more, for a small share of what they have."""
    rng = np.random.default_rng(3)
    exact = [waves(number * INTERVAL, frequency) for number in range(4)]
    noisy = [heights + rng.normal(0.0, noise, heights.shape) for heights in exact]
    truth = sampled(told(exact, 0.0))[1]
    error = {said: sampled(told(noisy, said))[1] - truth for said in (noise, 0.0)}
    assert np.sqrt(np.square(error[noise]).mean()) < 0.5 * np.sqrt(np.square(error[0.0]).mean())
    bias = sampled(told(exact, noise))[1] - truth
    assert np.sqrt(np.square(bias).mean()) < 0.1 * np.sqrt(np.square(truth).mean())


def test_exact_velocities_beside_noisy_heights_are_taken_as_they_are() -> None:
    rng = np.random.default_rng(4)
    heightmap = HeightMap(np.zeros((9, 9)), motion=MotionConfig(noise=0.01))
    speeds = rng.normal(0.0, 0.1, (9, 9))
    heightmap.replace(rng.normal(0.0, 0.01, (9, 9)), time=INTERVAL, velocities=speeds)
    np.testing.assert_allclose(sampled(heightmap)[1], speeds, atol=1e-6)


def test_variances_that_come_with_a_map_are_its_noise() -> None:
    rng = np.random.default_rng(5)
    maps = [rng.normal(0.0, 0.01, (20, 20)) for _ in range(4)]
    told_once = told(maps, 0.01)
    with_each = HeightMap(maps[0], variance=1e-4)
    for number, heights in enumerate(maps[1:], start=1):
        variance = np.full(heights.shape, 1e-4)
        variance[0, 0] = np.nan
        with_each.replace(heights, time=number * INTERVAL, variance=variance)
    np.testing.assert_allclose(sampled(with_each, 0.02)[0], sampled(told_once, 0.02)[0], atol=1e-7)
