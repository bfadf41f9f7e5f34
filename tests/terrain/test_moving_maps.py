"""How maps, and meshes, are moved on in time from what their updates told."""

import math
from typing import get_args

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, Terrain
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import BLOCK, MotionConfig, MotionMode
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.examples import examples
from tests.terrain.surfaces import told

SIDE = 2 * BLOCK + 10
EVERYTHING = np.arange(SIDE * SIDE)
SMOOTH = (MotionConfig(mode="interpolate"), MotionConfig(smoothing=2.0))
MOTIONS = (MotionConfig(), *SMOOTH)
# The block of each sample.
BLOCKS = np.add.outer(1000 * (np.arange(SIDE) // BLOCK), np.arange(SIDE) // BLOCK)

corners = st.integers(0, SIDE - 1)
regions = st.tuples(corners, corners, st.integers(1, SIDE), st.integers(1, SIDE))
parts = st.lists(st.integers(1, SIDE - 1), max_size=3, unique=True).map(sorted)


def ground(time: float, w: float = 4.0) -> FloatArray:
    r, c = np.indices((20, 30)) * 0.25
    return np.asarray(0.3 * np.sin(0.8 * r + 0.6 * c + w * time))


@examples(25)
@pytest.mark.parametrize("motion", MOTIONS)
@given(parts, st.lists(st.floats(0.01, 0.2), min_size=1, max_size=4), st.integers(0, 10**6), st.floats(0.0, 0.3))
@example([BLOCK + 3], [0.05, 0.05, 0.05], 0, 0.02)  # in a block that both parts share
@example([BLOCK + 3], [0.05, 0.05, 0.05], 1, 0.02)
def test_a_map_that_comes_in_parts_moves_as_the_whole_map_does(
    motion: MotionConfig, borders: list[int], intervals: list[float], seed: int, age: float
) -> None:
    """Also if it comes as a whole after its parts, as with every odd seed."""
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=(SIDE, SIDE)).astype(np.float32)
    whole, pieces = (HeightMap(shape, resolution=1.0, time=0.0, motion=motion) for _ in range(2))
    time = 0.0
    for interval in intervals:
        time += interval
        shape = shape + rng.normal(scale=0.02, size=shape.shape).astype(np.float32)
        whole.replace(shape, time=time)
        for first, last in zip([0, *borders], [*borders, SIDE], strict=True):
            pieces.update_region(0, first, shape[:, first:last], time=time)
        if seed % 2:
            pieces.replace(shape, time=time)
    expected, found = (mesh.sample(EVERYTHING, time + age, 0.01) for mesh in (whole, pieces))
    np.testing.assert_allclose(found.heights, expected.heights, atol=1e-4)
    np.testing.assert_allclose(found.velocities, expected.velocities, atol=1e-2)


@examples(25)
@given(st.lists(st.tuples(regions, st.floats(0.005, 0.3), st.floats(-1.0, 1.0)), min_size=1, max_size=5))
def test_an_update_moves_only_what_it_covers_and_blocks_that_it_does_not_meet_go_on(
    updates: list[tuple[tuple[int, int, int, int], float, float]],
) -> None:
    heightmap, time = HeightMap(np.zeros((SIDE, SIDE)), resolution=1.0, time=0.0), 0.0
    covered, known = np.zeros((SIDE, SIDE), bool), np.zeros((SIDE, SIDE), np.float32)
    for (row, column, height, width), interval, by in updates:
        time += interval
        part = (slice(row, row + height), slice(column, column + width))
        before = heightmap.sample(EVERYTHING, time, 0.01)
        known[part] += by
        heightmap.update_region(row, column, known[part], time=time)
        np.testing.assert_array_equal(heightmap.heights, known)
        after = heightmap.sample(EVERYTHING, time, 0.01)
        covered[part] = True
        others = ~np.isin(BLOCKS, BLOCKS[part]).ravel()
        np.testing.assert_array_equal(after.heights[others], before.heights[others])
        np.testing.assert_array_equal(after.velocities[others], before.velocities[others])
    for age in (0.0, 0.02, 0.3):
        samples = heightmap.sample(EVERYTHING, time + age, 0.01)
        assert not samples.heights.reshape(SIDE, SIDE)[~covered].any()
        assert not samples.velocities.reshape(SIDE, SIDE)[~covered].any()


def test_what_a_region_leaves_out_of_its_block_is_at_rest() -> None:
    """Although it moved with each map before."""
    heightmap = told([np.full((9, 9), 0.01 * step) for step in range(6)], 0.05 * np.arange(6))
    heightmap.update_region(2, 2, np.full((3, 3), 0.1), time=0.3)
    expected = np.zeros((9, 9))
    expected[2:5, 2:5] = 1.0
    np.testing.assert_allclose(heightmap.sample(np.arange(81), 0.3).velocities.reshape(9, 9), expected, atol=1e-6)


# Heights of maps 0.05 s apart [m], and the acceleration of the ground that they tell [m/s^2].
PATHS = {
    "stops": ([0.0, 0.1, 0.2, 0.3, 0.3], 0.0),
    "starts": ([0.0, 0.0, 0.0, 0.0, 0.1], 0.0),
    "turns": ([0.0, 0.1, 0.2, 0.3, 0.2], 0.0),
    "swings": ([0.0, 0.1, 0.2, 0.4, 0.5], 0.0),
    "slows": ([0.0, 0.1, 0.2, 0.3, 0.375], 0.0),
    "jolts": ([0.0, 0.0, 0.05, 0.15, 0.75], 80.0),  # four times the one before
    "jumped": ([-25.1, -15.1, -5.1, -0.1, 0.0], 0.0),  # at more than the largest velocity
}


@pytest.mark.parametrize(("path", "acceleration"), PATHS.values(), ids=PATHS)
def test_ground_is_never_carried_past_its_velocity_without_an_acceleration_that_two_changes_agree_on(
    path: list[float], acceleration: float
) -> None:
    """The velocity between the last two maps is that of the middle between them."""
    heightmap = told([np.full((5, 5), height) for height in path], 0.05 * np.arange(5))
    for age in np.linspace(0.0, 0.05, 11):
        height = float(heightmap.sample(np.array([12]), 0.2 + age).heights[0])
        expected = path[-1] + (path[-1] - path[-2]) * age / 0.05 + 0.5 * acceleration * age * (age + 0.05)
        assert height == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name", ["stops", "starts", "turns", "swings", "slows"])
def test_interpolated_ground_that_jolts_goes_straight_to_its_last_map_but_for_the_velocity_it_has(name: str) -> None:
    path, _ = PATHS[name]
    heightmap = told([np.full((5, 5), height) for height in path], 0.05 * np.arange(5), SMOOTH[0])
    before, after = np.diff(path)[-2:]
    for share in np.linspace(0.0, 1.0, 11):
        height = float(heightmap.sample(np.array([12]), 0.2 + 0.05 * share).heights[0])
        had = share * (1.0 - share) ** 2 * (before - after)
        assert height == pytest.approx(path[-2] + share * after + had, abs=1e-6)


JUMPS = [(0.0, 5.0, 0.1), (math.nan, 0.1, 0.1), (0.0, 0.1, 0.3)]


@pytest.mark.parametrize("mode", get_args(MotionMode))
@pytest.mark.parametrize(
    ("how", "before", "height", "time"),
    [*((how, *jump) for how in ("replaced", "put") for jump in JUMPS), ("put", 0.0, 0.1, -1.0)],
)
def test_fast_changes_filled_holes_and_late_maps_and_those_of_an_earlier_time_are_jumps(
    mode: MotionMode, how: str, before: float, height: float, time: float
) -> None:
    motion = MotionConfig(mode=mode, max_interval=0.25, max_velocity=25.0)
    terrain = Terrain(HeightMap(np.full((5, 5), before), resolution=1.0, motion=motion))
    if how == "put":
        terrain.put("", HeightMap(np.full((5, 5), height), resolution=1.0, time=time, motion=motion))
    else:
        terrain.tile("").replace(np.full((5, 5), height), time=time)  # type: ignore[union-attr]
    for age in (0.0, 0.05):
        found = terrain.at([[1.5, 2.5]], time + age)
        assert (found.heights[0], found.velocities[0]) == (pytest.approx(height), 0.0)


def test_given_velocities_tell_the_acceleration_at_the_instants_they_hold_for() -> None:
    """Ground that falls freely is where it falls to."""

    def height(time: float) -> FloatArray:
        return np.full((5, 5), -0.5 * 9.81 * time**2)

    heightmap = HeightMap(height(0.0), resolution=1.0, time=0.0, velocities=np.zeros((5, 5)))
    for time in (0.05, 0.1):
        heightmap.replace(height(time), time=time, velocities=np.full((5, 5), -9.81 * time))
    found = heightmap.sample(np.array([12]), 0.14, 1e-6)
    assert found.heights[0] == pytest.approx(-0.5 * 9.81 * 0.14**2, abs=1e-6)
    assert found.velocities[0] == pytest.approx(-9.81 * 0.14, rel=1e-4)


SAMPLES = np.arange(25)


@given(
    st.floats(-1.0, 1.0), st.floats(-4.0, 4.0), st.floats(-20.0, 20.0), st.floats(0.02, 0.1), st.booleans(),
    st.floats(0.0, 1.0),
)  # fmt: skip
@example(-0.5, 1.0, 5.0, 0.1, False, 0.5)  # it turns about
def test_interpolated_ground_is_that_of_a_map_interval_before(
    v: float, a: float, jerk: float, interval: float, given_velocities: bool, share: float
) -> None:
    """At uneven times, exactly, for heights that are cubic in time and do not jolt: position, velocity, and the rise in
    a step."""
    enough = math.copysign(1.0, v) * (1.0 + abs(v) + 10.0 * abs(a) * interval + 30.0 * abs(jerk) * interval**2)
    speed = v if a * jerk >= 0.0 else enough

    def height(t: float) -> float:
        return speed * t + 0.5 * a * t**2 + jerk * t**3 / 6.0

    heightmap = HeightMap(np.zeros((3, 3)), resolution=1.0, motion=SMOOTH[0])
    for t in np.array([1.0, 2.0, 2.6, 3.2, 4.2]) * interval:
        rate = np.full((3, 3), speed + a * t + 0.5 * jerk * t**2) if given_velocities else None
        heightmap.replace(np.full((3, 3), height(t)), time=t, velocities=rate)
    then, ahead = (3.2 + share) * interval, (1.0 - share) * interval + 1e-9
    found = heightmap.sample(np.zeros(1, np.int64), then + interval, ahead)
    assert found.heights[0] == pytest.approx(height(then), abs=2e-6)
    assert found.velocities[0] * ahead == pytest.approx(height(then + ahead) - height(then), abs=2e-6)


@examples(40)
@given(
    st.lists(st.tuples(st.just(0.0) | st.floats(0.005, 0.3), st.booleans(), st.booleans()), min_size=2, max_size=8),
    st.sampled_from(SMOOTH), st.integers(0, 10**6),
)  # fmt: skip
def test_smooth_ground_jumps_at_no_update(
    updates: list[tuple[float, bool, bool]], motion: MotionConfig, seed: int
) -> None:
    """Neither its height nor its velocity, whatever the stamps, with whole maps and with regions, unless the maps are
    too far apart for a motion."""
    rng = np.random.default_rng(seed)
    heightmap, time = HeightMap(np.zeros((5, 5)), resolution=1.0, motion=motion), 0.0
    for interval, part, says in updates:
        time += interval
        before = heightmap.sample(SAMPLES, time)
        rises = heightmap.has_velocities
        rows = slice(0, 2) if part else slice(None)
        new = (heightmap.heights + rng.normal(scale=0.05, size=(5, 5)))[rows]
        velocities = rng.normal(size=new.shape) if says else None
        heightmap.update_region(0, 0, new, time=time, velocities=velocities)
        after = heightmap.sample(SAMPLES, time)
        if interval > motion.max_interval or not (rises and heightmap.has_velocities):
            continue
        newest = heightmap.arrays[1][heightmap.arrays[2]["newest"].item()]
        kept = np.abs(newest.ravel()) <= motion.max_velocity
        np.testing.assert_allclose(after.heights[kept], before.heights[kept], atol=1e-6)
        np.testing.assert_allclose(after.velocities[kept], before.velocities[kept], atol=1e-4)


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_velocity_of_the_ground_is_the_rate_of_its_height(motion: MotionConfig) -> None:
    """While maps come, are late, and are gone; and a rise is the difference of two heights."""
    times = [0.05 * k + 0.01 * (k % 2) for k in range(7)]
    heightmap = told([ground(time) for time in times], times, motion)
    for time in np.linspace(0.301, 0.7, 80):
        here, there = (heightmap.sample(np.arange(600), float(time + by), 5e-4) for by in (0.0, 5e-4))
        middle = heightmap.sample(np.arange(600), float(time + 2.5e-4)).velocities
        rise = there.heights - here.heights
        turning = np.abs(rise / 5e-4 - middle) > 2e-3 + 0.01 * np.abs(middle)
        assert turning.sum() in (0, 600)  # at the instant at which maps are late it turns back
        if not turning.any():
            np.testing.assert_allclose(here.velocities * 5e-4, rise, atol=1e-9)


@examples(25)
@example([(0.0, True, False), (0.0, True, True)], 0, 0.0, MotionConfig())  # a part of a map keeps velocities beside it
@given(
    st.lists(st.tuples(st.just(0.0) | st.floats(0.01, 0.3), st.booleans(), st.booleans()), min_size=1, max_size=5),
    st.integers(0, 10**6), st.floats(0.0, 0.5), st.sampled_from(MOTIONS),
)  # fmt: skip
def test_vertices_move_along_any_line_as_samples_of_a_map_do_along_z(
    updates: list[tuple[float, bool, bool]], seed: int, age: float, motion: MotionConfig
) -> None:
    """All, or the first row alone; with velocities or without."""
    rng, way = np.random.default_rng(seed), np.array([0.5, -1.0, 2.0])
    r, c = np.divmod(np.arange(12), 4)
    start, z = np.stack([c, r, 0 * r], axis=1), rng.normal(size=12).astype(np.float32)
    mesh = TriangleMesh(start + z[:, None] * way, grid_triangles(3, 4), time=0.0, motion=motion)
    heightmap, time = HeightMap(z.reshape(3, 4), resolution=1.0, time=0.0, motion=motion), 0.0
    for interval, says, part in updates:
        time += interval
        moved = np.arange(4 if part else 12)
        z[moved] += rng.normal(scale=0.01, size=len(moved)).astype(np.float32)
        speed = rng.normal(size=len(moved)).astype(np.float32) if says else None
        heightmap.update_region(
            0, 0, z[moved].reshape(-1, 4), time=time, velocities=None if speed is None else speed.reshape(-1, 4)
        )
        mesh.move(
            start[moved] + z[moved, None] * way, time=time, indices=moved if part else None,
            velocities=None if speed is None else speed[:, None] * way,
        )  # fmt: skip
    expected, found = heightmap.sample(np.arange(12), time + age, 0.01), mesh.sample(np.arange(12), time + age, 0.01)
    np.testing.assert_allclose(found.positions, start + expected.heights[:, None] * way, atol=2e-5)
    np.testing.assert_allclose(found.velocities, expected.velocities[:, None] * way, atol=2e-3)


def test_a_clock_set_back_takes_the_maps_with_it() -> None:
    times = 10.0 + np.arange(4) * 0.05
    heightmap = told([ground(time) for time in times], times)
    before = heightmap.sample(np.arange(600), 10.17, 0.01)
    heightmap.shift_time(-10.0)
    after = heightmap.sample(np.arange(600), 0.17, 0.01)
    np.testing.assert_allclose(after.heights, before.heights, atol=1e-9)
    np.testing.assert_allclose(after.velocities, before.velocities, atol=1e-6)
