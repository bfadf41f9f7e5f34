"""Grid traversal finds the nearest vertex."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.report.search import nearest_vertices
from smartmesh_ros.terrain.grid import GridGeometry


@given(
    st.integers(3, 40),
    st.integers(3, 40),
    st.floats(0.05, 5.0),
    st.floats(-math.pi, math.pi),
    st.integers(0, 10**6),
)
def test_agrees_with_brute_force_inside_on_the_rim_and_outside(
    rows: int, columns: int, resolution: float, yaw: float, seed: int
) -> None:
    geometry = GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=(3.0, -2.0, 0.0), yaw=yaw)
    rng = np.random.default_rng(seed)
    around = geometry.to_world(rng.uniform(-5, rows + 5, 50), rng.uniform(-5, columns + 5, 50))
    found = nearest_vertices(geometry, geometry.to_grid(around))
    inner_rows, inner_columns = np.meshgrid(np.arange(1, rows - 1), np.arange(1, columns - 1), indexing="ij")
    vertices = geometry.to_world(inner_rows.ravel(), inner_columns.ravel())
    distance = np.linalg.norm(around[:, None] - vertices, axis=2)
    chosen = np.linalg.norm(around - geometry.to_world(found.rows, found.columns), axis=1)
    np.testing.assert_allclose(chosen, distance.min(axis=1), rtol=1e-9, atol=1e-9)
    assert found.rows.min() >= 1
    assert found.rows.max() <= rows - 2


def test_ties_go_to_the_lower_row_and_column() -> None:
    geometry = GridGeometry(rows=10, columns=10, resolution=1.0)
    found = nearest_vertices(geometry, np.array([[6.5, 4.5], [3.5, 5.5]]))
    np.testing.assert_array_equal(found.rows, [6, 3])
    np.testing.assert_array_equal(found.columns, [4, 5])
