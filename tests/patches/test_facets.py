"""Triangles against balls and boxes, checked against points sampled densely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros.patches.facets import (
    Facet,
    Plane,
    Point,
    Solid,
    ball_gap,
    box_gap,
    closest_point,
    deviation_near,
    gap_to,
    height_of,
    plane_normal,
    plane_of,
    reach_along,
)
from smartmesh_ros.patches.shapes import solid_of
from tests.bodies import FORMS, Form, random_turn, rotation
from tests.examples import examples

# Barycentric coordinates of points all over a triangle, STEP of its edges apart, corners and edges among them.
STEP = 1.0 / 48.0
SHARES = np.array([(i, j, 48 - i - j) for i in range(49) for j in range(49 - i)]) * STEP

seeds = st.integers(0, 10**9)


def triangle(rng: np.random.Generator, *, upright: bool = False) -> np.ndarray:
    """Corners (3, 3): cells of a map steep and flat, slivers, and triangles that stand anyhow."""
    corners = rng.normal(size=(3, 3))
    if not upright:
        corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
        corners[:, 2] = rng.normal(scale=rng.choice([1e-3, 0.3, 3.0]), size=3)
        if rng.random() < 0.5:
            corners = corners[:, [1, 0, 2]][[0, 2, 1]]
    return np.asarray(corners * rng.choice([0.05, 1.0, 5.0]))


def as_facet(corners: np.ndarray) -> Facet:
    return Facet(*(Point(*corner) for corner in corners.tolist()))


def box_at(rng: np.random.Generator, corners: np.ndarray) -> tuple[Solid, np.ndarray]:
    """A box turned anyhow near a triangle, and its axes as rows (3, 3)."""
    axes = np.eye(3) if rng.random() < 0.3 else rotation(random_turn(rng)).T
    size = np.abs(corners - corners.mean(axis=0)).max()
    half = size * np.exp(rng.uniform(-3.0, 1.0, 3))
    centre = corners.mean(axis=0) + rng.normal(size=3) * (size + half.max()) * rng.choice([0.3, 1.0])
    return Solid(False, 0.0, Point(*centre), *(Point(*axis) for axis in axes), Point(*half)), axes


def distance_to_box(points: np.ndarray, solid: Solid, axes: np.ndarray) -> np.ndarray:
    """Of points (n, 3), exactly."""
    own = (points - np.array(solid.centre)) @ axes.T
    return np.asarray(np.linalg.norm(np.maximum(np.abs(own) - np.array(solid.half), 0.0), axis=1))


@given(seeds, st.booleans())
def test_the_closest_point_is_on_the_triangle_and_none_is_closer(seed: int, upright: bool) -> None:
    rng = np.random.default_rng(seed)
    corners = triangle(rng, upright=upright)
    size = np.abs(corners - corners[0]).max()
    p = corners.mean(axis=0) + rng.normal(size=3) * size * rng.choice([0.1, 1.0, 5.0])
    found = np.array(closest_point(as_facet(corners), Point(*p)))
    shares = np.linalg.lstsq(np.vstack([corners.T, np.ones(3) * size]), np.append(found, size), rcond=None)[0]
    assert shares.min() >= -1e-9
    np.testing.assert_allclose(shares @ corners, found, atol=1e-9 * size)
    sampled = np.linalg.norm(SHARES @ corners - p, axis=1).min()
    assert np.linalg.norm(found - p) <= sampled + 1e-12


@pytest.mark.parametrize(
    ("p", "expected"),
    [
        ((0.6, 0.2, 5.0), (0.6, 0.2, 0.0)),  # over its inside
        ((0.5, -2.0, 1.0), (0.5, 0.0, 0.0)),  # beside an edge
        ((-1.0, -1.0, 0.0), (0.0, 0.0, 0.0)),
        ((3.0, -1.0, 0.0), (1.0, 0.0, 0.0)),
        ((1.5, 2.0, -3.0), (1.0, 1.0, 0.0)),
        ((0.0, 1.0, 0.0), (0.5, 0.5, 0.0)),  # beside the diagonal
    ],
)
def test_the_closest_point_of_each_part_of_a_triangle(
    p: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    facet = Facet(Point(0.0, 0.0, 0.0), Point(1.0, 0.0, 0.0), Point(1.0, 1.0, 0.0))
    assert tuple(closest_point(facet, Point(*p))) == pytest.approx(expected)
    gap = ball_gap(facet, Point(*p), 0.5)
    away = np.subtract(p, expected)
    assert gap.distance == pytest.approx(np.linalg.norm(away) - 0.5)
    np.testing.assert_allclose(gap.normal, away / np.linalg.norm(away), atol=1e-12)


def test_a_ball_whose_centre_is_on_a_facet_is_pushed_out_on_the_side_that_bodies_are_on() -> None:
    facet = Facet(Point(0.0, 0.0, 0.0), Point(1.0, 0.0, 1.0), Point(1.0, 1.0, 1.0))
    gap = ball_gap(facet, Point(0.6, 0.2, 0.6), 0.5)
    assert gap.distance == -0.5
    np.testing.assert_allclose(gap.normal, np.array([-1.0, 0.0, 1.0]) / math.sqrt(2.0), atol=1e-12)


@examples(400)
@given(seeds, st.booleans())
def test_a_box_is_never_said_to_be_farther_than_it_is(seed: int, upright: bool) -> None:
    """And it is said to touch where it touches, and only there."""
    rng = np.random.default_rng(seed)
    corners = triangle(rng, upright=upright)
    solid, axes = box_at(rng, corners)
    gap = box_gap(as_facet(corners), solid)
    size = np.abs(corners - corners[0]).max()
    sampled = distance_to_box(SHARES @ corners, solid, axes).min()
    assert gap.distance <= sampled + 1e-12
    if gap.distance <= 0.0:
        assert sampled <= 2.0 * STEP * size, "it says that they overlap"
    assert np.linalg.norm(gap.normal) == pytest.approx(1.0)
    # The direction is that of an axis that separates by so much, seen from the facet.
    low = min(np.array(gap.normal) @ (np.array(solid.centre) - corner) for corner in corners)
    assert low - reach_along(solid, gap.normal) == pytest.approx(gap.distance, abs=1e-9 * (1.0 + size))


@pytest.mark.parametrize(
    ("centre", "expected"),
    [
        ((0.6, 0.3, 1.5), 1.0),  # a side of the box over the inside of the triangle
        ((3.0, 0.5, 0.0), 1.5),  # beside an edge
        ((0.6, 0.3, 0.2), -0.3),  # in it
    ],
)
def test_the_gap_of_boxes_of_which_it_is_known(centre: tuple[float, float, float], expected: float) -> None:
    facet = Facet(Point(0.0, 0.0, 0.0), Point(1.0, 0.0, 0.0), Point(1.0, 1.0, 0.0))
    x, y, z = Point(1.0, 0.0, 0.0), Point(0.0, 1.0, 0.0), Point(0.0, 0.0, 1.0)
    solid = Solid(False, 0.0, Point(*centre), x, y, z, Point(0.5, 0.5, 0.5))
    assert box_gap(facet, solid).distance == pytest.approx(expected)


@examples(400)
@given(seeds, st.booleans())
@example(0, True)
def test_the_deviation_near_a_solid_is_that_of_every_point_it_can_touch(seed: int, ball: bool) -> None:
    rng = np.random.default_rng(seed)
    corners = triangle(rng)
    facet, size = as_facet(corners), float(np.abs(corners[:, :2]).max())
    solid, axes = box_at(rng, corners)
    if ball:
        solid = solid._replace(ball=True, radius=max(solid.half))
    plane = Plane(float(rng.normal(scale=0.2 * size)), *rng.normal(scale=0.3, size=2).tolist())
    gap, margin = gap_to(facet, solid), float(size * rng.choice([0.0, 0.1, 1.0]))
    points = SHARES @ corners
    centre = np.array(solid.centre)
    away = np.linalg.norm(points - centre, axis=1) - solid.radius if ball else distance_to_box(points, solid, axes)
    touched = points[away <= margin]
    off = np.abs(touched[:, 2] - height_of(plane, 0.0, 0.0) - touched[:, :2] @ (plane.slope_x, plane.slope_y))
    bound = deviation_near(facet, plane, solid, gap, margin)
    assert (off <= bound + 1e-9 * (1.0 + size)).all()
    corner_off = [abs(z - height_of(plane, x, y)) for x, y, z in corners.tolist()]
    assert bound <= max(corner_off) + 1e-12, "and no more than it is at the corners"


@given(seeds)
def test_the_plane_of_a_facet_goes_through_its_corners(seed: int) -> None:
    corners = triangle(np.random.default_rng(seed))
    plane = plane_of(as_facet(corners))
    for x, y, z in corners.tolist():
        assert height_of(plane, x, y) == pytest.approx(z, abs=1e-9 * np.abs(corners).max())
    normal = np.array(plane_normal(plane))
    assert normal[2] > 0.0
    np.testing.assert_allclose((corners - corners[0]) @ normal, 0.0, atol=1e-9 * np.abs(corners).max())


@given(seeds, st.sampled_from(FORMS))
def test_the_solid_of_a_shape_holds_all_of_it(seed: int, form: str) -> None:
    """Balls exactly; boxes exactly; what is round by the box around it."""
    rng = np.random.default_rng(seed)
    shape = Form(form, 0.3, rng)
    body = np.concatenate([rng.normal(size=3), random_turn(rng), np.zeros(6)])
    solid = solid_of(np.array([shape.record]).view(np.recarray)[0], body)
    own = shape.surface(rng, 200)
    points = own @ rotation(body[3:7]).T + body[:3]
    away = points - np.array(solid.centre)
    assert np.linalg.norm(points - body[:3], axis=1).max() <= shape.radius + 1e-9
    if shape.ball:
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), solid.radius, atol=1e-9)
        return
    axes = np.array([solid.u, solid.v, solid.w])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    over = np.abs(away @ axes.T) - np.array(solid.half)
    assert over.max() <= 1e-9
    for direction in rng.normal(size=(5, 3)):
        unit = direction / np.linalg.norm(direction)
        assert (away @ unit).max() <= reach_along(solid, Point(*unit)) + 1e-9
