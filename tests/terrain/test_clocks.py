"""What the clocks of a map's blocks say holds for every sample."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros.terrain.clocks import BLOCK
from smartmesh_ros.terrain.heightmap import HeightMap

SIDE = 3 * BLOCK + 10

corners = st.integers(0, SIDE - 1)
regions = st.tuples(corners, corners, st.integers(1, 2 * BLOCK), st.integers(1, 2 * BLOCK))


def raise_region(heightmap: HeightMap, region: tuple[int, int, int, int], by: float, time: float) -> None:
    row, column, height, width = region
    part = heightmap.heights[row : row + height, column : column + width]
    heightmap.update_region(row, column, part + by, time=time)


@given(st.lists(regions, min_size=1, max_size=4), corners, corners, st.integers(0, 2 * BLOCK), st.integers(0, 3))
@example([(BLOCK, 0, 1, 1)], BLOCK + 1, 0, BLOCK - 1, 0)  # between the blocks of the corners
def test_a_patch_without_a_changed_block_has_not_changed(
    updates: list[tuple[int, int, int, int]], row: int, column: int, reach: int, seen: int
) -> None:
    heightmap = HeightMap(np.zeros((SIDE, SIDE)), time=0.0)
    patch = (slice(max(row - reach, 0), row + reach + 1), slice(max(column - reach, 0), column + reach + 1))
    version, before = heightmap.version, heightmap.heights[patch].copy()
    for index, region in enumerate(updates):
        raise_region(heightmap, region, 1.0, 0.1 * (index + 1))
        if index < seen:
            version, before = heightmap.version, heightmap.heights[patch].copy()
    one = np.array([row]), np.array([column]), np.array([reach]), np.array([version])
    if not heightmap.clocks.changed(*one)[0]:
        np.testing.assert_array_equal(heightmap.heights[patch], before)


@given(
    st.lists(st.tuples(regions, st.floats(0.005, 0.1), st.floats(-1.0, 1.0)), min_size=1, max_size=5),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_until_it_says_so_all_ground_goes_on_in_straight_lines(
    updates: list[tuple[tuple[int, int, int, int], float, float]], first: float, second: float
) -> None:
    heightmap, time = HeightMap(np.zeros((SIDE, SIDE)), time=0.0), 0.0
    for region, interval, by in updates:
        time += interval
        raise_region(heightmap, region, by, time)
    end = min(heightmap.steady_until, time + 1.0)
    if end <= time:
        return
    indices = np.arange(0, SIDE * SIDE, 97)
    start, *later = (
        heightmap.sample(indices[:, None], indices, when)
        for when in (time, time + first * (end - time), time + second * (end - time))
    )
    rates = np.zeros_like(start.heights) if start.velocities is None else start.velocities
    for share, samples in zip((first, second), later, strict=True):
        expected = start.heights + rates * share * (end - time)
        np.testing.assert_allclose(samples.heights, expected, atol=1e-5)


def test_ground_that_came_to_rest_does_not_unsettle_what_moves() -> None:
    """One region stream has ended long ago, another goes on."""
    heightmap = HeightMap(np.zeros((SIDE, SIDE)), time=0.0)
    for index in range(1, 4):
        raise_region(heightmap, (0, 0, 8, 8), 0.1, 0.2 * index)
    for index in range(200):
        raise_region(heightmap, (2 * BLOCK, 2 * BLOCK, 8, 8), 0.001, 0.6 + 0.01 * (index + 1))
    assert math.isclose(heightmap.lifetime, 0.01)
    assert heightmap.steady_until > heightmap.time
