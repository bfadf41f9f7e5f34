"""Maps whose stamps are uneven: jitter, bursts and drops do not make velocity, and no map is late too soon."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import INTERVALS_KEPT
from tests.examples import examples
from tests.terrain.motion_law import LATE_AFTER

INTERVAL = 0.05
EVERYTHING = np.arange(25)
RNG = np.random.default_rng(6)


def rising(times: FloatArray, speed: float = 1.0, noise: float = 0.0) -> HeightMap:
    """A map told at so many times of ground that rises evenly."""
    heightmap = HeightMap(np.zeros((5, 5)), time=0.0)
    for time in times.tolist():
        heightmap.replace(np.full((5, 5), speed * time) + RNG.normal(0.0, noise, (5, 5)), time=time)
    return heightmap


def bursts(spacing: float) -> FloatArray:
    """Five maps one right after the other every five intervals."""
    starts = 5.0 * INTERVAL * np.arange(1, 7)
    return (starts[:, None] + spacing * np.arange(5)).ravel()


@pytest.mark.parametrize("spacing", [0.001, 0.003, 0.006, 0.01])
def test_a_burst_makes_no_velocity_of_noise(spacing: float) -> None:
    """What noise makes of maps that lie close together is divided by the time to the maps before them."""
    heightmap = rising(bursts(spacing), speed=0.0, noise=0.01)
    speeds = heightmap.sample(EVERYTHING, heightmap.time).velocities
    assert np.abs(speeds).max() < 4.0 * 0.01 * np.sqrt(2.0) / (4.0 * INTERVAL)


@examples(40)
@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=20), st.floats(-2.0, 2.0))
def test_ground_that_rises_evenly_does_so_whatever_the_stamps(shares: list[float], speed: float) -> None:
    """Maps up to two intervals apart, or so close together that they are one that came in parts."""
    heightmap = rising(np.cumsum([INTERVAL, *(INTERVAL * share for share in shares)]), speed)
    found = heightmap.sample(EVERYTHING, heightmap.time)
    np.testing.assert_allclose(found.velocities, speed, atol=1e-4 + 0.09 * abs(speed))


@pytest.mark.parametrize("spacing", [0.004, 0.01])
def test_a_burst_tells_the_velocity_since_the_one_before(spacing: float) -> None:
    found = rising(bursts(spacing))
    assert found.sample(EVERYTHING, found.time).velocities == pytest.approx(1.0, abs=0.05)


def test_after_drops_the_ground_goes_on_for_as_long_as_they_took() -> None:
    """Every third map is missing: the ground is no further behind in the gap than between the others."""
    times = INTERVAL * np.array([k for k in range(1, 30) if k % 3])
    heightmap = rising(times)
    for age in np.linspace(0.0, 2.0 * INTERVAL, 9):
        heights = heightmap.sample(EVERYTHING, float(times[-1] + age)).heights
        assert heights == pytest.approx(times[-1] + age, abs=1e-5)


def test_maps_that_come_faster_again_are_missed_sooner() -> None:
    slow = 0.2 * np.arange(1, 10)
    fast = slow[-1] + 0.02 * np.arange(1, INTERVALS_KEPT + 1)
    heightmap = rising(np.concatenate([slow, fast]))
    assert heightmap.lifetime == pytest.approx(0.02)
    late = heightmap.time + (LATE_AFTER + 0.5) * 0.02
    assert (heightmap.sample(EVERYTHING, late).velocities < 0.0).all()  # back to where it was seen last
