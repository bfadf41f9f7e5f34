"""Maps that travel with a robot keep the ground's velocity where they overlap."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.scrolling import cells_moved, sliding, velocities_across


def surface(geometry: GridGeometry, time: float) -> np.ndarray:
    """Ground that rises at 0.5 m/s in the west and falls in the east, by its place in the world."""
    xy = geometry.to_world(*np.mgrid[: geometry.rows, : geometry.columns])
    return (np.sin(xy[..., 0]) + xy[..., 1] - 0.5 * time * xy[..., 0]).astype(np.float32)


@settings(deadline=None)
@given(
    rows=st.integers(-7, 7),
    columns=st.integers(-9, 9),
    yaw=st.floats(-3.0, 3.0),
    resolution=st.floats(0.05, 1.0),
)
def test_velocities_of_shared_samples_are_those_of_the_ground(
    rows: int, columns: int, yaw: float, resolution: float
) -> None:
    before = GridGeometry(rows=8, columns=10, resolution=resolution, origin=(3.0, -2.0, 0.0), yaw=yaw)
    x, y = before.to_world(rows, columns)
    after = GridGeometry(rows=8, columns=10, resolution=resolution, origin=(float(x), float(y), 0.0), yaw=yaw)
    assert cells_moved(before, after) == (rows, columns)
    old = HeightMap(surface(before, 0.0), geometry=before, time=0.0)
    velocities = velocities_across(old, after, surface(after, 0.1), 0.1)
    assert velocities is not None
    shared = ~np.isnan(velocities)
    assert shared.sum() == (8 - abs(rows)) * (10 - abs(columns))
    wanted = -0.5 * after.to_world(*np.mgrid[:8, :10])[..., 0]
    assert np.abs(velocities - wanted)[shared].max() < 1e-3


@pytest.mark.parametrize(
    "changes",
    [{"resolution": 0.2}, {"rows": 9}, {"yaw": 0.1}, {"origin": (0.05, 0.0, 0.0)}, {"origin": (0.0, 0.0, 1.0)}],
)
def test_another_grid_tells_nothing(changes: dict[str, float]) -> None:
    before = GridGeometry(rows=8, columns=10, resolution=0.1)
    after = GridGeometry(**{"rows": 8, "columns": 10, "resolution": 0.1, **changes})  # type: ignore[arg-type]
    assert cells_moved(before, after) is None


def test_maps_far_apart_in_space_or_time_tell_nothing() -> None:
    geometry = GridGeometry(rows=8, columns=10, resolution=0.1)
    old = HeightMap(np.zeros((8, 10)), geometry=geometry, time=0.0)
    near = GridGeometry(rows=8, columns=10, resolution=0.1, origin=(0.1, 0.0, 0.0))
    far = GridGeometry(rows=8, columns=10, resolution=0.1, origin=(1.0, 0.0, 0.0))
    new = np.ones((8, 10), np.float32)
    assert velocities_across(old, near, new, 0.1) is not None
    assert velocities_across(old, far, new, 0.1) is None
    assert velocities_across(old, near, new, 5.0) is None
    assert velocities_across(old, near, new, 0.0) is None


def at(x: float, time: float, **geometry: float) -> HeightMap:
    return HeightMap(np.zeros((8, 10)), resolution=0.1, origin=(x, 0.0), time=time, **geometry)  # type: ignore[arg-type]


def test_ground_whose_map_comes_elsewhere_slides() -> None:
    assert sliding(at(0.0, 1.0), at(0.03, 1.1)) == pytest.approx((0.3, 0.0))


@pytest.mark.parametrize(
    "after", [at(0.2, 1.1), at(0.03, 3.0), at(0.03, 1.0), at(0.03, 1.1, yaw=0.1), at(7.03, 1.1)],
    ids=["by whole cells", "long ago", "at once", "another grid", "too far for a motion"],
)  # fmt: skip
def test_a_map_that_travels_or_jumps_does_not(after: HeightMap) -> None:
    assert sliding(at(0.0, 1.0), after) == (0.0, 0.0)


def test_ground_that_slides_goes_on_when_its_next_map_comes_very_soon() -> None:
    """By less than a hundredth of a cell: ground at rest stays at rest, as a map's place is never quite the same."""
    before, after = at(0.03, 1.1), at(0.0306, 1.102)
    assert sliding(before, after) == (0.0, 0.0)
    before.slide((0.3, 0.0), 0.1)
    assert sliding(before, after) == pytest.approx((0.3, 0.0))
    assert sliding(before, at(0.03, 1.2)) == (0.0, 0.0)
