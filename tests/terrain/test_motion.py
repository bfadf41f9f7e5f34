"""Velocities of noisy ground count as far as they stand out of the noise."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from smartmesh_ros import HeightMap, InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig


@pytest.mark.parametrize(
    "bad",
    [
        {"mode": "guess"}, {"max_interval": 0.0}, {"max_velocity": math.nan}, {"changes": "guess"}, {"settle": 0.0},
        {"noise": math.nan}, {"min_interval": 1.0}, {"min_interval": -1.0}, {"smoothing": -1.0},
        {"smoothing": math.nan}, {"smoothing": 11.0},
    ],
)  # fmt: skip
def test_impossible_settings_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(InputError):
        MotionConfig(**bad)  # type: ignore[arg-type]


SIDE = 70  # more than a block
NOISY_INTERVAL = 0.05
AHEAD = 0.01


def told(maps: list[FloatArray], noise: float, interval: float = NOISY_INTERVAL) -> HeightMap:
    heightmap = HeightMap(maps[0], resolution=1.0, time=0.0, motion=MotionConfig(noise=noise))
    for number, heights in enumerate(maps[1:], start=1):
        heightmap.replace(heights, time=number * interval)
    return heightmap


def sampled(heightmap: HeightMap, age: float = 0.0) -> tuple[FloatArray, FloatArray]:
    rows, columns = heightmap.geometry.rows, heightmap.geometry.columns
    found = heightmap.sample(np.arange(rows * columns), heightmap.time + age, AHEAD)
    return found.heights.reshape(rows, columns), found.velocities.reshape(rows, columns)


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
    exact = [waves(number * NOISY_INTERVAL, frequency) for number in range(4)]
    noisy = [heights + rng.normal(0.0, noise, heights.shape) for heights in exact]
    truth = sampled(told(exact, 0.0))[1]
    error = {said: sampled(told(noisy, said))[1] - truth for said in (noise, 0.0)}
    assert np.sqrt(np.square(error[noise]).mean()) < 0.5 * np.sqrt(np.square(error[0.0]).mean())
    bias = sampled(told(exact, noise))[1] - truth
    assert np.sqrt(np.square(bias).mean()) < 0.1 * np.sqrt(np.square(truth).mean())


def test_exact_velocities_beside_noisy_heights_are_taken_as_they_are() -> None:
    rng = np.random.default_rng(4)
    heightmap = HeightMap(np.zeros((9, 9)), resolution=1.0, motion=MotionConfig(noise=0.01))
    speeds = rng.normal(0.0, 0.1, (9, 9))
    heightmap.replace(rng.normal(0.0, 0.01, (9, 9)), time=NOISY_INTERVAL, velocities=speeds)
    np.testing.assert_allclose(sampled(heightmap)[1], speeds, atol=1e-6)


def test_variances_that_come_with_a_map_are_its_noise() -> None:
    rng = np.random.default_rng(5)
    maps = [rng.normal(0.0, 0.01, (20, 20)) for _ in range(4)]
    told_once = told(maps, 0.01)
    with_each = HeightMap(maps[0], resolution=1.0, variance=1e-4)
    for number, heights in enumerate(maps[1:], start=1):
        variance = np.full(heights.shape, 1e-4)
        variance[0, 0] = np.nan
        with_each.replace(heights, time=number * NOISY_INTERVAL, variance=variance)
    np.testing.assert_allclose(sampled(with_each, 0.02)[0], sampled(told_once, 0.02)[0], atol=1e-7)
