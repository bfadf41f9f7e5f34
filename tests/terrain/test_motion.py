"""The motion of ground whose maps are noisy, late, or come at uneven times.

Velocities of noisy ground count as far as they stand out of the noise.
"""

from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from smartmesh_ros import HeightMap, Terrain
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.grid_track import moved_on
from smartmesh_ros.terrain.motion import INTERVALS_KEPT, MotionConfig, MotionMode
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.examples import examples
from tests.terrain.surfaces import mesh_of, told

SIDE = 70  # more than a block
INTERVAL = 0.05
AHEAD = 0.01


def in_noise(maps: list[NDArray[np.float64]], noise: float, interval: float = INTERVAL) -> HeightMap:
    return told(maps, interval * np.arange(len(maps)), MotionConfig(noise=noise))


def sampled(heightmap: HeightMap, age: float = 0.0) -> tuple[FloatArray, FloatArray]:
    rows, columns = heightmap.geometry.rows, heightmap.geometry.columns
    found = heightmap.sample(np.arange(rows * columns), heightmap.time + age, AHEAD)
    return found.heights.reshape(rows, columns), found.velocities.reshape(rows, columns)


def waves(time: float, frequency: float) -> NDArray[np.float64]:
    x, y = np.meshgrid(0.25 * np.arange(SIDE), 0.25 * np.arange(SIDE))
    return np.asarray(0.3 * np.sin(np.hypot(x - 8.0, y - 8.0) + frequency * time))


STEEP = np.add.outer(2.0 * np.arange(SIDE), np.arange(SIDE))


@pytest.mark.parametrize(
    ("form", "rate", "share"),
    [
        *((lambda time: STEEP, rate, 1.0 / 7.0) for rate in (5.0, 20.0, 60.0)),
        *((partial(waves, frequency=frequency), 20.0, 0.5) for frequency in (1.0, 4.0)),
    ],
    ids=["still, 5 Hz", "still, 20 Hz", "still, 60 Hz", "slow waves", "fast waves"],
)
@pytest.mark.parametrize("noise", [0.002, 0.005])
def test_most_of_the_noise_of_velocities_is_gone_and_waves_keep_theirs(
    form: Callable[[float], FloatArray], rate: float, share: float, noise: float
) -> None:
    """All but a share of what it is where the noise is not told, for a small share of what the waves have."""
    rng, exact = np.random.default_rng(3), [form(number / rate) for number in range(4)]
    noisy = [heights + rng.normal(0.0, noise, heights.shape) for heights in exact]
    truth = sampled(in_noise(exact, 0.0, 1.0 / rate))[1]

    def error(maps: list[NDArray[np.float64]], said: float) -> float:
        return float(np.sqrt(np.square(sampled(in_noise(maps, said, 1.0 / rate))[1] - truth).mean()))

    assert error(noisy, 0.0) > noise * rate
    assert error(noisy, noise) < share * error(noisy, 0.0)
    assert error(exact, noise) <= 0.1 * np.sqrt(np.square(truth).mean())


def test_exact_velocities_beside_noisy_heights_are_taken_as_they_are() -> None:
    rng = np.random.default_rng(4)
    heightmap = HeightMap(np.zeros((9, 9)), resolution=1.0, motion=MotionConfig(noise=0.01))
    speeds = rng.normal(0.0, 0.1, (9, 9))
    heightmap.replace(rng.normal(0.0, 0.01, (9, 9)), time=INTERVAL, velocities=speeds)
    np.testing.assert_allclose(sampled(heightmap)[1], speeds, atol=1e-6)


def test_variances_that_come_with_a_map_are_its_noise() -> None:
    rng = np.random.default_rng(5)
    maps = [rng.normal(0.0, 0.01, (20, 20)) for _ in range(4)]
    once = in_noise(maps, 0.01)
    with_each = HeightMap(maps[0], resolution=1.0, variance=1e-4)
    for number, heights in enumerate(maps[1:], start=1):
        variance = np.full(heights.shape, 1e-4)
        variance[0, 0] = np.nan
        with_each.replace(heights, time=number * INTERVAL, variance=variance)
    np.testing.assert_allclose(sampled(with_each, 0.02)[0], sampled(once, 0.02)[0], atol=1e-7)


SAMPLES = np.arange(25)


def rising(times: NDArray[np.float64], speed: float = 1.0, noise: float = 0.0) -> HeightMap:
    """A map told at so many times of ground that rises evenly."""
    rng, times = np.random.default_rng(6), np.array([0.0, *times])
    return told([np.full((5, 5), speed * time) + rng.normal(0.0, noise, (5, 5)) for time in times], times)


@pytest.mark.parametrize("spacing", [0.001, 0.003, 0.006, 0.01])
def test_a_burst_makes_no_velocity_of_noise(spacing: float) -> None:
    """What noise makes of maps that lie close together is divided by the time to the maps before them."""
    starts = 5.0 * INTERVAL * np.arange(1, 7)
    heightmap = rising(np.add.outer(starts, spacing * np.arange(5)).ravel(), speed=0.0, noise=0.01)
    speeds = heightmap.sample(SAMPLES, heightmap.time).velocities
    assert np.abs(speeds).max() < 4.0 * 0.01 * np.sqrt(2.0) / (4.0 * INTERVAL)


@examples(40)
@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=20), st.floats(-2.0, 2.0))
def test_ground_that_rises_evenly_does_so_whatever_the_stamps(shares: list[float], speed: float) -> None:
    """Maps up to two intervals apart, or so close together that they are one that came in parts."""
    heightmap = rising(np.cumsum([INTERVAL, *(INTERVAL * share for share in shares)]), speed)
    found = heightmap.sample(SAMPLES, heightmap.time)
    np.testing.assert_allclose(found.velocities, speed, atol=1e-4 + 0.09 * abs(speed))


@pytest.mark.parametrize("start", [-10.0, 0.0, 10.0])
@pytest.mark.parametrize("is_mesh", [False, True])
def test_ground_that_rises_has_its_velocity_whenever_it_began(start: float, is_mesh: bool) -> None:
    ground: HeightMap | TriangleMesh = HeightMap(np.zeros((5, 5)), resolution=1.0, time=start)
    if is_mesh:
        ground = mesh_of(ground, time=start)
    for k in range(1, 4):
        if isinstance(ground, TriangleMesh):
            ground.move(ground.vertices + [0.0, 0.0, 0.1], time=start + 0.1 * k)
        else:
            ground.replace(np.full((5, 5), 0.1 * k), time=start + 0.1 * k)
    assert Terrain(ground).at([[2.0, 2.0]], start + 0.3).velocities == pytest.approx([1.0])


def test_maps_are_missed_after_the_longest_gap_of_late() -> None:
    """Every third map is dropped: the ground goes on for as long as that takes. Maps that come faster again are missed
    sooner."""
    times = INTERVAL * np.array([k for k in range(1, 30) if k % 3])
    dropped = rising(times)
    for age in np.linspace(0.0, 2.0 * INTERVAL, 9):
        assert dropped.sample(SAMPLES, float(times[-1] + age)).heights == pytest.approx(times[-1] + age, abs=1e-5)
    slow = 0.2 * np.arange(1, 10)
    fast = slow[-1] + 0.02 * np.arange(1, INTERVALS_KEPT + 1)
    heightmap = rising(np.concatenate([slow, fast]))
    late = heightmap.time + 2.0 * 0.02
    assert (heightmap.sample(SAMPLES, late).velocities < 0.0).all()  # back to where it was seen last


@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("mode", get_args(MotionMode))
def test_ground_whose_next_map_is_late_returns_to_its_last_one_at_half_the_speed(
    mode: MotionMode, delay: float
) -> None:
    """And rests there. Before its last map it is no farther back than at the map before. A grid that slides and turns
    does the same."""
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0, motion=MotionConfig(mode=mode))
    heightmap.delay = delay
    for k in range(1, 5):
        heightmap.replace(np.full((5, 5), INTERVAL * k), time=INTERVAL * k)
    heightmap.slide((0.3, -0.2), INTERVAL, spin=2.0)
    due = INTERVAL + delay
    behind, farthest = (due, due) if mode == "interpolate" else (0.0, INTERVAL)
    turn = 1.5 * due - behind

    def way(since: float) -> float:
        return since if since <= turn else max(1.5 * turn - 0.5 * since, 0.0)

    for age in np.linspace(-0.2, 0.5, 71):
        gone = way(max(age - behind, -INTERVAL))
        speed = 1.0 if age - behind <= turn else -0.5 * (gone > 0.0)
        if mode == "hold":
            gone, speed = 0.0, float(age <= turn)
        time = heightmap.time + age
        now, until_it_rests = (heightmap.sample(SAMPLES, time, ahead) for ahead in (1e-6, 10.0))
        np.testing.assert_allclose(now.heights - heightmap.heights[0, 0], gone, atol=1e-6)
        np.testing.assert_allclose(now.velocities, speed, atol=1e-4)
        assert speed > 0.0 or 10.0 * until_it_rests.velocities == pytest.approx(-gone, abs=1e-5)
        assert heightmap.moving(time) == (age < 4.5 * due)
        placed, along = heightmap.placed_at(time), 0.0 if mode == "hold" else way(max(age - behind, -farthest))
        there = moved_on(heightmap.geometry, heightmap.track.motion, along)
        assert (*placed.origin[:2], placed.yaw) == pytest.approx(there, abs=1e-9)
