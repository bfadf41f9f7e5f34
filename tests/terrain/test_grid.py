"""Where samples lie."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import GridGeometry, InputError

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
