"""Heights that are given to a height map, where they lie in memory, and velocities that come with them."""

import mmap
from pathlib import Path

import numpy as np
import pytest

from smartmesh_ros import HeightMap, Terrain
from smartmesh_ros.terrain.motion import MotionConfig


def test_a_given_velocity_holds_for_one_map_which_may_be_put_in_place_of_another() -> None:
    heightmap = HeightMap(np.zeros((10, 10)), resolution=1.0, velocities=np.full((10, 10), 1.5))
    heightmap.replace(np.zeros((10, 10)), time=0.2)
    np.testing.assert_allclose(heightmap.sample(np.array([55]), 0.2).velocities, 0.0, atol=1e-6)
    terrain = Terrain(HeightMap(np.zeros((10, 10)), resolution=1.0))
    terrain.put("", HeightMap(np.full((10, 10), 0.05), resolution=1.0, time=0.1, velocities=np.full((10, 10), -2.0)))
    np.testing.assert_allclose(terrain.at([[5.0, 5.0]], 0.1).velocities, -2.0)


def resident() -> int:
    """Resident memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * mmap.PAGESIZE


@pytest.mark.skipif(not Path("/proc/self/statm").is_file(), reason="needs /proc")
def test_a_large_map_takes_its_bytes_once_until_it_moves() -> None:
    """Regions take what they cover; only a whole second map takes the map's bytes again."""
    heights = np.ones((4097, 4097), np.float32)
    before = resident()
    heightmap = HeightMap(heights, resolution=1.0)
    for step in range(1, 20):
        heightmap.update_region(64 * step, 64 * step, np.full((64, 64), 0.1 * step), time=0.1 * step)
    assert resident() - before < 1.2 * heights.nbytes
    heightmap.replace(heights, time=3.0)
    assert resident() - before < 2.2 * heights.nbytes


@pytest.mark.parametrize("rows", [1, -1])
def test_rows_of_a_map_may_be_written_at_another_place_of_it(rows: int) -> None:
    before = np.random.default_rng(0).normal(size=(150, 100)).astype(np.float32)
    heightmap = HeightMap(before, resolution=1.0)
    taken, put = (slice(0, -1), 1) if rows > 0 else (slice(1, None), 0)
    heightmap.update_region(put, 0, heightmap.heights[taken], time=1.0)
    np.testing.assert_array_equal(heightmap.heights[put : put + 149], before[taken])


def test_heights_may_lie_at_any_address() -> None:
    """A message's bytes need not start at a multiple of four."""
    new = np.arange(12, dtype=np.float32).reshape(3, 4)
    shifted = np.frombuffer(b"\0" + new.tobytes(), np.float32, 12, 1).reshape(3, 4)
    for motion in (MotionConfig(), MotionConfig(changes="correction", noise=0.01)):
        heightmap = HeightMap(shifted, resolution=1.0, motion=motion)
        heightmap.replace(shifted, time=0.1, velocities=shifted, variance=shifted)
        heightmap.update_region(1, 0, shifted[1:], time=0.2)
        np.testing.assert_allclose(heightmap.heights, new, rtol=1e-6)
