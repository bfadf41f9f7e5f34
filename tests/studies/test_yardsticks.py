"""The yardsticks themselves: distances against brute force and closed forms, and figures of runs that are known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import Box, Capsule, Cylinder, GridGeometry, HeightMap
from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.tools.evaluation.clearance import clearances, skin
from smartmesh_ros.tools.evaluation.distance import Surface, nearest
from smartmesh_ros.tools.evaluation.measures import held_up, penetration
from tests.bodies import random_turn, reach
from tests.terrain.surfaces import distances, highest, triangles_of


def surface(heights: np.ndarray, resolution: float, z: float = 0.0) -> Surface:
    rows, columns = heights.shape
    return Surface(GridGeometry(rows=rows, columns=columns, resolution=resolution, origin=(-1.0, 0.5, z)), heights)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 1.0), st.integers(0, 3))
def test_it_is_the_distance_to_every_triangle_of_rough_ground_with_holes(seed: int, rough: float, holes: int) -> None:
    rng = np.random.default_rng(seed)
    heights = rng.normal(0.0, rough, (7, 8))
    heights[rng.integers(0, 7, holes), rng.integers(0, 8, holes)] = np.nan
    heightmap = HeightMap(heights, resolution=0.3, origin=(-1.0, 0.5, 0.2))
    facets, ground = triangles_of(heightmap, 0.0), surface(heightmap.heights.astype(np.float64), 0.3, 0.2)
    points = np.column_stack([rng.uniform(-1.0, 1.1, 6), rng.uniform(0.5, 2.3, 6), rng.normal(0.2, 1.0, 6)])
    found = nearest(ground, points, 1.5).distance
    below = highest(facets, points + (0.0, 0.0, np.inf)).values
    np.testing.assert_allclose(ground.below(points), below, atol=1e-9)
    np.testing.assert_allclose(np.abs(found), np.minimum(distances(facets, points, np.inf), 1.5), atol=1e-9)
    np.testing.assert_array_equal(found < 0.0, points[:, 2] < below)
    assert np.isnan(nearest(ground, np.array([[np.nan, 0.0, 0.0]]), 1.5).distance)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_turned_shapes_reach_down_by_their_support_function(seed: int) -> None:
    rng = np.random.default_rng(seed)
    orientation = random_turn(rng)[None]
    down = rotated(orientation * (-1.0, -1.0, -1.0, 1.0), np.array([0.0, 0.0, -1.0]))[0]
    ground = surface(np.zeros((50, 50)), 0.1)
    rim = 0.2 * (1.0 - math.cos(math.pi / 24))  # it is sampled, and at most so much short of the support function
    for shape, slack in (
        (Box(0.5, 0.3, 0.2), 0.0), (Capsule(radius=0.1, height=0.4), 0.0), (Cylinder(radius=0.2, height=0.3), rim),
    ):  # fmt: skip
        found = clearances(ground, shape, np.array([[1.5, 3.0, 0.05]]), orientation, reach=1.0)[0]
        assert -1e-9 <= found - (0.05 - reach(shape, down)) <= slack + 1e-9
        assert skin(shape).points.shape[1] == 3


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.3))
def test_leaving_out_points_that_cannot_be_nearest_changes_nothing(seed: int, rough: float) -> None:
    rng = np.random.default_rng(seed)
    ground = surface(rng.normal(0.0, rough, (20, 20)), 0.1)
    orientation = random_turn(rng)[None]
    position = np.array([[0.0, 1.5, rng.uniform(-0.2, 0.6)]])
    box = Box(0.5, 0.3, 0.2)
    every = nearest(ground, (position[:, None] + rotated(orientation[:, None], skin(box).points))[0], 1.0).distance
    assert clearances(ground, box, position, orientation, reach=1.0)[0] == pytest.approx(every.min(), abs=1e-12)


def test_percentiles_leave_lost_bodies_out_from_when_they_are_lost_and_hover_is_of_what_is_held_up() -> None:
    """The last two are over the map at first only."""
    clearance = np.array([[-0.01, -0.02, 0.5, 0.04], [-0.01, -0.9, np.nan, np.nan], [-0.01, -0.9, np.nan, np.nan]])
    below, held = np.zeros((2, 3, 4), bool)
    below[1, 1], held[:, 3] = True, True
    found = penetration(clearance, below, held)
    assert (found.p50, found.most, found.lost, found.bodies) == (pytest.approx(0.01), pytest.approx(0.02), 1, 4)
    assert found.hover == pytest.approx(0.04)


def test_a_falling_body_is_not_held_up_and_a_resting_one_is() -> None:
    before = np.array([[1.0, 0.0, -2.0], [0.0, 0.0, 0.0]])
    after = np.array([[1.0, 0.0, -2.0 - 9.81 / 240.0], [0.0, 0.0, 0.0]])
    assert held_up(before, after, 1.0 / 240.0).tolist() == [False, True]
