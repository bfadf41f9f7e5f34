"""The motion of a patch of a general mesh is that of the ground under its body."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.report.mesh import mesh_twist

numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)

PLACES = np.array([[x, y, 0.1 * x * y] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)])


@given(vectors, vectors, vectors)
def test_a_rigid_motion_is_found_wherever_the_body_is(
    linear: np.ndarray, angular: np.ndarray, body: np.ndarray
) -> None:
    found = mesh_twist(PLACES, linear + np.cross(angular, PLACES), body, 1.0)
    np.testing.assert_allclose(found, (linear, angular), atol=1e-6)


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7))
def test_where_the_velocity_is_curved_that_at_the_body_counts(x: float, y: float) -> None:
    """A rate of x^2: the mean over the patch is 2 / 3 everywhere."""
    velocities = np.zeros((9, 3))
    velocities[:, 2] = PLACES[:, 0] ** 2
    linear, angular = mesh_twist(PLACES, velocities, np.array([x, y, 0.3]), 0.5)
    facet = abs(x)  # between the vertices at 0 and 1 or -1
    assert abs((linear + np.cross(angular, [x, y, 0.0]))[2] - facet) < 0.12


def test_vertices_as_far_away_as_numbers_reach_have_a_twist_of_numbers() -> None:
    far = np.array([[0.0, 0.0, 0.0], [1e200, 0.0, 0.0], [0.0, 1e200, 0.0]])
    linear, angular = mesh_twist(far, far, np.full(3, 5e199), 1e200)
    assert np.isfinite(linear).all() and np.isfinite(angular).all()
