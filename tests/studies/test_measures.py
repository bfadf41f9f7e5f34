"""Figures of a run, on runs whose figures are known."""

import numpy as np
import pytest

from smartmesh_ros.tools.evaluation.measures import deviation, held_up, penetration
from studies.matrix.still_ground import angles_between


def test_percentiles_leave_lost_bodies_out_from_when_they_are_lost() -> None:
    clearance = np.array([[-0.01, -0.02], [-0.01, -0.9], [-0.01, -0.9]])
    below = np.array([[False, False], [False, True], [False, False]])
    found = penetration(clearance, below, np.ones_like(below))
    assert (found.p50, found.most, found.lost, found.bodies) == (pytest.approx(0.01), pytest.approx(0.02), 1, 2)


def test_hover_counts_only_what_is_held_up() -> None:
    clearance = np.array([[0.5, 0.04], [0.5, 0.04]])
    held = np.array([[False, True], [False, True]])
    found = penetration(clearance, np.zeros_like(held), held)
    assert found.hover == pytest.approx(0.04)
    assert found.p99 == 0.0


def test_a_falling_body_is_not_held_up_and_a_resting_one_is() -> None:
    before = np.array([[1.0, 0.0, -2.0], [0.0, 0.0, 0.0]])
    after = np.array([[1.0, 0.0, -2.0 - 9.81 / 240.0], [0.0, 0.0, 0.0]])
    assert held_up(before, after, 1.0 / 240.0).tolist() == [False, True]


def test_angles_and_deviation() -> None:
    small = np.radians(0.001)
    normals = np.array([[np.sin(small), 0.0, np.cos(small)], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(angles_between(normals, np.array([[0.0, 0.0, 1.0]] * 2)), [0.001, 180.0], rtol=1e-6)
    assert deviation(np.zeros((2, 1, 3)), np.array([[[0.0, 3.0, 4.0]]] * 2)).tolist() == [[5.0], [5.0]]
