"""When the report's colliders are refreshed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, Terrain
from smartmesh_ros.report.schedule import FIRST_MAPS, LONGEST_LIFE, SHORTEST_LIFE, UpdateSchedule

DT = 1.0 / 240.0


@given(
    rate=st.sampled_from([0.0, 30.0, 60.0, 100.0, 120.0, 240.0, 1000.0]),
    maps=st.lists(st.booleans(), min_size=1, max_size=60),
    dt=st.sampled_from([1.0 / 60.0, DT, 1.0 / 960.0]),
)
def test_patches_are_due_with_maps_and_no_later_than_the_rate_says(rate: float, maps: list[bool], dt: float) -> None:
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0)
    terrain, schedule = Terrain.of(heightmap), UpdateSchedule()
    steps = max(round(1.0 / (rate * dt)), 1) if rate else 1
    age, lasts, waiting = 0, 0, False
    for step, comes in enumerate(maps):
        if comes:
            heightmap.replace(np.full((5, 5), 0.001 * step), time=step * dt)
        waiting |= comes
        age += 1
        if schedule.due(terrain):
            lasts = schedule.begin(terrain, step * dt, dt, rate)
            assert 1 <= lasts <= (LONGEST_LIFE * steps if steps > 1 else 1)
            age, waiting = 0, False
        assert not waiting or age < SHORTEST_LIFE * steps, "a map is left for later only if patches are new"
        assert age < lasts, "nor are they left longer than they were made for"


def followed(maps: int) -> list[int]:
    """Steps of 120 in which patches at 60 Hz are brought up to date, with a map every so many steps."""
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0)
    terrain, schedule, found = Terrain.of(heightmap), UpdateSchedule(), []
    for step in range(120):
        if step % maps == 0:
            heightmap.replace(np.full((5, 5), 0.001 * step), time=step * DT)
        if schedule.due(terrain):
            lasts = schedule.begin(terrain, step * DT, DT, 60.0)
            assert lasts <= LONGEST_LIFE * 4
            found.append(step)
    return found


def test_of_many_maps_patches_follow_the_first_at_once_and_then_some() -> None:
    found = followed(1)
    assert found[:FIRST_MAPS] == list(range(FIRST_MAPS))
    assert set(np.diff(found[FIRST_MAPS:]).tolist()) == {2}


@pytest.mark.parametrize(
    ("maps", "rate", "lasts"), [(1, 240.0, 1), (1, 60.0, 1), (2, 60.0, 2), (4, 60.0, 5), (12, 60.0, 4)]
)
def test_patches_last_until_the_next_map_if_that_is_soon(maps: int, rate: float, lasts: int) -> None:
    """Maps every so many steps. One that comes a little late is waited for."""
    heightmap = HeightMap(np.zeros((5, 5)), resolution=1.0)
    terrain, schedule = Terrain.of(heightmap), UpdateSchedule()
    for number in range(3):
        heightmap.replace(np.full((5, 5), 0.001 * number), time=number * maps * DT)
    assert schedule.begin(terrain, 2 * maps * DT, DT, rate) == lasts


def test_new_tiles_are_followed_at_once() -> None:
    terrain, schedule = Terrain.of(HeightMap(np.zeros((5, 5)), resolution=1.0)), UpdateSchedule()
    schedule.begin(terrain, 0.0, DT, 10.0)
    assert not schedule.due(terrain)
    terrain.put("", HeightMap(np.ones((5, 5)), resolution=1.0))
    assert schedule.due(terrain)
