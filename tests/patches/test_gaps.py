"""Triangles against solids, checked against points sampled densely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.patches.facets import (
    Facet,
    Point,
    closest_point,
    height_of,
    plane_normal,
    plane_of,
)
from smartmesh_ros.patches.gaps import ball_gap, box_gap, gap_to
from smartmesh_ros.patches.shapes import BodyShape, box, solid_of
from smartmesh_ros.patches.solids import Solid, extents, reach_along
from tests.bodies import FORMS, Form, random_turn, rotation, shapes_of
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


def at_pose(shape: BodyShape, position: np.ndarray, turn: np.ndarray) -> Solid:
    """The solid of a shape on a body."""
    return solid_of(shapes_of([shape]), 0, np.concatenate([position, turn, np.zeros(6)]))


def box_at(rng: np.random.Generator, corners: np.ndarray) -> tuple[Solid, np.ndarray]:
    """A box turned anyhow near a triangle, and its axes as rows (3, 3)."""
    turn = np.array([0.0, 0.0, 0.0, 1.0]) if rng.random() < 0.3 else random_turn(rng)
    size = np.abs(corners - corners.mean(axis=0)).max()
    half = size * np.exp(rng.uniform(-3.0, 1.0, 3))
    centre = corners.mean(axis=0) + rng.normal(size=3) * (size + half.max()) * rng.choice([0.3, 1.0])
    return at_pose(box(2.0 * half), centre, turn), rotation(turn).T


def form_at(rng: np.random.Generator, name: str, corners: np.ndarray) -> tuple[Form, np.ndarray, np.ndarray, Solid]:
    """A form turned anyhow near a triangle: itself, its position, its turn, and the solid."""
    size = np.abs(corners - corners.mean(axis=0)).max()
    form = Form(name, size * float(np.exp(rng.uniform(-2.0, 0.5))), rng)
    centre = corners.mean(axis=0) + rng.normal(size=3) * (size + form.radius) * rng.choice([0.3, 0.8])
    turn = random_turn(rng)
    return form, centre, turn, at_pose(form.shape, centre, turn)


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
    solid = at_pose(box((1.0, 1.0, 1.0)), np.array(centre), np.array([0.0, 0.0, 0.0, 1.0]))
    assert box_gap(facet, solid).distance == pytest.approx(expected)


@examples(400)
@given(seeds, st.sampled_from(FORMS), st.booleans())
def test_the_gap_of_a_form_is_none_where_points_of_the_triangle_are_inside(seed: int, name: str, upright: bool) -> None:
    """And a gap is the distance of a plane that separates the two."""
    rng = np.random.default_rng(seed)
    corners = triangle(rng, upright=upright)
    form, centre, turn, solid = form_at(rng, name, corners)
    gap, size = gap_to(as_facet(corners), solid), np.abs(corners - corners[0]).max()
    if form.inside(SHARES @ corners, centre, rotation(turn)).any():
        assert gap.distance <= 1e-9 * size
    assert np.linalg.norm(gap.normal) == pytest.approx(1.0)
    if gap.distance > 1e-9:
        surface = form.surface(rng, 400) @ rotation(turn).T + centre
        ahead = (surface @ gap.normal).min() - (corners @ gap.normal).max()
        assert ahead >= gap.distance - 1e-6 * (1.0 + size) or name == "compound"
        limited = gap_to(as_facet(corners), solid, 0.3 * gap.distance)
        assert 0.3 * gap.distance - 2e-6 <= limited.distance <= gap.distance + 2e-6


@examples(400)
@given(seeds, st.sampled_from(FORMS), st.booleans())
def test_a_gap_beyond_what_matters_is_still_beyond_it(seed: int, name: str, upright: bool) -> None:
    """And gaps within both limits are exact to the bit."""
    rng = np.random.default_rng(seed)
    corners = triangle(rng, upright=upright)
    _, _, _, solid = form_at(rng, name, corners)
    facet = as_facet(corners)
    exact, size = gap_to(facet, solid), float(np.abs(corners - corners[0]).max())
    limit, near = (exact.distance + size * rng.normal(0.0, 0.5, 2)).tolist()
    limit = max(limit, 0.0)  # a solid's motion
    gap = gap_to(facet, solid, limit, near)
    assert gap.distance <= exact.distance + 2e-6
    if exact.distance <= min(limit, near):
        assert gap == exact
    for threshold in (limit, min(limit, near)):
        if abs(exact.distance - threshold) > 2e-6:
            assert (gap.distance > threshold) == (exact.distance > threshold)


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
def test_a_solid_reaches_as_far_as_its_surface(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    form = Form(name, 0.3, rng)
    position, turn = rng.normal(size=3), random_turn(rng)
    solid = at_pose(form.shape, position, turn)
    points = form.surface(rng, 4000) @ rotation(turn).T + position
    away = points - np.array(solid.centre)
    assert np.linalg.norm(points - position, axis=1).max() <= form.radius + 1e-9
    axes = np.array([solid.u, solid.v, solid.w])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert (np.abs(away) <= np.array(extents(solid)) + 1e-9).all()
    assert (np.abs(away @ axes.T) <= np.array(solid.half) + solid.rounding + 1e-9).all()
    for direction in rng.normal(size=(5, 3)):
        unit = direction / np.linalg.norm(direction)
        farthest, reach = (away @ unit).max(), reach_along(solid, Point(*unit))
        assert farthest - 1e-9 <= reach <= farthest + 0.15 * form.radius  # between the points
