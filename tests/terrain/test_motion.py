"""What the ground does between two maps, sample by sample: properties of the law that the core's reader gives.

Velocities of noisy ground count as far as they stand out of the noise.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from smartmesh_ros import HeightMap, InputError
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import Mode, MotionConfig
from tests.terrain.motion_law import LATE_AFTER, REST_AFTER, Phase, displacement, phase_of, rise_of

AGES = np.linspace(0.0, 1.0, 2001)
INTERVAL = 0.1

velocities = st.floats(-10.0, 10.0)
accelerations = st.floats(-100.0, 100.0)


def phase_at(age: float, mode: Mode = Mode.EXTRAPOLATE, lag: float = 0.5 * INTERVAL) -> Phase:
    """Of ground whose last map came at time 0 and is due again after an INTERVAL."""
    return phase_of(age, 0.0, INTERVAL, lag, int(mode))


def height_at(age: float, velocity: float, acceleration: float, mode: Mode = Mode.EXTRAPOLATE) -> float:
    return displacement(velocity, acceleration, phase_at(age, mode))


@given(velocities, accelerations, st.floats(0.0, 0.6), st.floats(1e-4, 0.1))
def test_ground_rises_by_the_difference_of_its_heights(v: float, a: float, age: float, ahead: float) -> None:
    """Within one part of its motion: until maps are late, or from then on until it rests."""
    patience = LATE_AFTER * INTERVAL
    if age <= patience < age + ahead:
        ahead = patience - age
    rise = rise_of(v, a, phase_at(age), ahead)
    assert rise == pytest.approx(height_at(age + ahead, v, a) - height_at(age, v, a), abs=1e-9 * (1 + abs(v) + abs(a)))


@given(velocities, accelerations)
@pytest.mark.parametrize("corner", [0.0, INTERVAL, LATE_AFTER * INTERVAL, REST_AFTER * INTERVAL])
def test_ground_jumps_nowhere(corner: float, v: float, a: float) -> None:
    """Not when the map comes, is due, is late or is gone."""
    assert height_at(corner + 1e-9, v, a) == pytest.approx(height_at(corner - 1e-9, v, a), abs=1e-6)


@given(velocities, accelerations, st.floats(LATE_AFTER * INTERVAL + 1e-6, REST_AFTER * INTERVAL), st.floats(0.0, 10.0))
def test_late_ground_returns_to_its_map_and_stays_there(v: float, a: float, age: float, ahead: float) -> None:
    here = height_at(age, v, a)
    there = here + rise_of(v, a, phase_at(age), ahead)
    assert abs(there) <= abs(here) + 1e-9
    assert there * here >= -1e-9


def test_an_interpolated_grid_is_at_its_last_place_when_the_next_is_due() -> None:
    """One map late; from then on it is late as an extrapolated one, and returns."""
    offset = np.array([height_at(age, 1.0, 0.0, Mode.INTERPOLATE) for age in AGES])
    assert offset[0] == -INTERVAL
    assert offset[AGES <= INTERVAL] == pytest.approx(AGES[AGES <= INTERVAL] - INTERVAL)
    assert offset.max() == pytest.approx((LATE_AFTER - 1.0) * INTERVAL)
    assert not offset[AGES >= (2.0 * LATE_AFTER - 0.5) * INTERVAL + 1e-9].any()


def test_hold_keeps_the_heights_and_carries_the_velocity_while_maps_come() -> None:
    assert all(height_at(age, 1.0, 5.0, Mode.HOLD) == 0.0 for age in AGES)
    assert phase_at(0.0, Mode.HOLD).rate == 1.0
    assert phase_at(1.0, Mode.HOLD).rate == 0.0


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
