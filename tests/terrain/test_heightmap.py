"""Where samples of a height map lie, and its heights, holes and motion."""

import math
import mmap
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import GridGeometry, HeightMap, InputError, Material
from smartmesh_ros.terrain.motion import MotionConfig
from tests.examples import examples


def velocity_at(heightmap: HeightMap, row: int, column: int, time: float) -> tuple[float, float]:
    """Height and velocity of one sample."""
    heights, velocities = heightmap.sample(np.array([row * heightmap.geometry.columns + column]), time)
    return float(heights[0]), float(velocities[0])


@given(st.floats(0, 8.999), st.floats(0, 6.999), st.integers(0, 10**6))
def test_sampling_follows_the_triangles_of_the_reports_diagonal(x: float, y: float, seed: int) -> None:
    heights = np.random.default_rng(seed).normal(size=(8, 10))
    row, column = int(y), int(x)
    v, u = y - row, x - column
    near, right, far, up = (heights[row + r, column + c] for r, c in ((0, 0), (0, 1), (1, 1), (1, 0)))
    # The diagonal runs from (row, column) to (row + 1, column + 1); each side of it is one plane.
    expected = near + u * (right - near) + v * (far - right) if u > v else near + v * (up - near) + u * (far - up)
    sampled = HeightMap(heights, resolution=1.0).at([[x, y]], 0.0).heights[0]
    assert sampled == pytest.approx(expected, abs=1e-5)


@examples(40)
@given(st.integers(0, 10**6), st.integers(1, 12), st.sampled_from([(3, 3), (40, 70), (65, 64), (130, 200)]))
def test_regions_in_place_equal_a_map_built_anew(seed: int, count: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    reference = rng.normal(size=shape).astype(np.float32)
    heightmap = HeightMap(reference.copy(), resolution=1.0, time=0.0)
    for step in range(1, count + 1):
        row, column = int(rng.integers(shape[0])), int(rng.integers(shape[1]))
        size = (int(rng.integers(1, shape[0] - row + 1)), int(rng.integers(1, shape[1] - column + 1)))
        region = rng.normal(size=size).astype(np.float32)
        region[rng.random(size) < 0.1] = np.nan
        heightmap.update_region(row, column, region, time=step * 0.01)
        reference[row : row + size[0], column : column + size[1]] = region
    np.testing.assert_array_equal(heightmap.heights, reference)


def test_a_given_velocity_is_used_and_holds_for_one_map() -> None:
    rising = np.full((10, 10), 1.5)
    rising[3, 3] = np.nan
    heightmap = HeightMap(np.zeros((10, 10)), resolution=1.0, time=0.0)
    heightmap.replace(np.zeros((10, 10)), time=0.1, velocities=rising)
    assert velocity_at(heightmap, 5, 5, 0.1)[1] == pytest.approx(1.5)
    assert velocity_at(heightmap, 3, 3, 0.1)[1] == 0.0
    heightmap.replace(np.zeros((10, 10)), time=0.2)
    assert velocity_at(heightmap, 5, 5, 0.2)[1] == pytest.approx(0.0, abs=1e-6)


def test_jumps_and_old_maps_give_no_velocity() -> None:
    motion = MotionConfig(max_interval=0.25, max_velocity=25.0)
    jumped = HeightMap(np.zeros((5, 5)), resolution=1.0, time=0.0, motion=motion)
    jumped.replace(np.full((5, 5), 3.0), time=0.1)
    assert velocity_at(jumped, 2, 2, 0.1) == (3.0, 0.0)
    late = HeightMap(np.zeros((5, 5)), resolution=1.0, time=0.0, motion=motion)
    late.replace(np.full((5, 5), 3.0), time=0.3)
    assert velocity_at(late, 2, 2, 0.35) == (3.0, 0.0)


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


def test_heights_may_lie_at_any_address() -> None:
    """A message's bytes need not start at a multiple of four."""
    new = np.arange(12, dtype=np.float32).reshape(3, 4)
    shifted = np.frombuffer(b"\0" + new.tobytes(), np.float32, 12, 1).reshape(3, 4)
    for motion in (MotionConfig(), MotionConfig(changes="correction", noise=0.01)):
        heightmap = HeightMap(shifted, resolution=1.0, motion=motion)
        heightmap.replace(shifted, time=0.1, velocities=shifted, variance=shifted)
        heightmap.update_region(1, 0, shifted[1:], time=0.2)
        np.testing.assert_allclose(heightmap.heights, new, rtol=1e-6)


geometries = st.builds(
    GridGeometry,
    rows=st.integers(3, 200),
    columns=st.integers(3, 200),
    resolution=st.floats(0.01, 10.0),
    origin=st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    yaw=st.floats(-math.pi, math.pi),
)


@given(geometries, st.floats(0, 199), st.floats(0, 199))
def test_grid_and_world_are_inverse(geometry: GridGeometry, row: float, column: float) -> None:
    back = geometry.to_grid(geometry.to_world(row, column))
    np.testing.assert_allclose(back, [row, column], atol=1e-6)


@given(geometries)
def test_rows_run_along_the_maps_y_and_columns_along_its_x(geometry: GridGeometry) -> None:
    origin, along_row, along_column = (geometry.to_world(*cell) for cell in ((0, 0), (1, 0), (0, 1)))
    x_axis = np.array([math.cos(geometry.yaw), math.sin(geometry.yaw)]) * geometry.resolution
    y_axis = np.array([-math.sin(geometry.yaw), math.cos(geometry.yaw)]) * geometry.resolution
    np.testing.assert_allclose(origin, geometry.origin[:2])
    np.testing.assert_allclose(along_column - origin, x_axis, atol=1e-9)
    np.testing.assert_allclose(along_row - origin, y_axis, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rows": 2}, "geometry"),
        ({"columns": 0}, "geometry"),
        ({"rows": 2**20, "columns": 2**20}, "size"),
        ({"resolution": 0.0}, "geometry"),
        ({"resolution": -0.1}, "geometry"),
        ({"resolution": math.nan}, "geometry"),
        ({"origin": (0.0, math.inf, 0.0)}, "geometry"),
        ({"yaw": math.nan}, "geometry"),
    ],
)
def test_impossible_geometry_is_refused(change: dict[str, object], reason: str) -> None:
    with pytest.raises(InputError) as error:
        GridGeometry(**{"rows": 10, "columns": 10, "resolution": 0.1, **change})  # type: ignore[arg-type]
    assert error.value.reason == reason


@pytest.mark.parametrize("how", ["replace", "update_region"])
@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        *(({"time": time}, "") for time in (math.nan, math.inf, 10**400, "soon", -1.0)),
        *(({"heights": np.full((9, 12), height)}, "non_finite") for height in (np.inf, 1e300)),
        ({"heights": np.full((9, 12), 1j)}, "type"),
        ({"velocities": np.zeros((3, 3))}, "length"),
        ({"velocities": np.full((9, 12), np.inf)}, "non_finite"),
        ({"variance": np.zeros((3, 3))}, "length"),
        ({"material": Material(rolling=0.1, stiffness=-1.0)}, "stiffness"),
    ],
)
def test_an_update_that_is_refused_changes_nothing(wrong: dict[str, Any], reason: str, how: str) -> None:
    given = {"heights": np.ones((9, 12)), "time": 1.0, **wrong}
    require_refused(how, (0, 0) if how == "update_region" else (), reason, **given)


@pytest.mark.parametrize(
    ("how", "place", "shape", "reason"),
    [
        ("replace", (), (9, 13), "length"), ("update_region", (7, 0), (3, 1), "region"),
        ("update_region", (0, -1), (1, 1), "region"), ("update_region", (0, 0), (0, 1), "length"),
        ("update_region", (0, 0), (3,), "length"),
    ],
)  # fmt: skip
def test_an_update_of_another_size_changes_nothing(
    how: str, place: tuple[int, ...], shape: tuple[int, ...], reason: str
) -> None:
    require_refused(how, place, reason, heights=np.zeros(shape), time=1.0)


def require_refused(how: str, place: tuple[int, ...], reason: str, heights: Any, **given: Any) -> None:
    """Assert that a map refuses an update for its reason, and is as before."""
    heightmap = HeightMap(np.zeros((9, 12)), resolution=0.1, material=Material(rolling=0.2))
    heightmap.press(np.array([[1, 1]]), np.array([-0.2], np.float32))
    before, revision = pickle.dumps(heightmap), heightmap.revision
    with pytest.raises(InputError) as error:
        getattr(heightmap, how)(*place, heights, **given)
    assert error.value.reason == reason or not reason
    assert (pickle.dumps(heightmap), heightmap.revision) == (before, revision)
