"""Where moving bodies meet the ground, and how high they lie on it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smartmesh_ros.patches.config import SELECTION, PatchConfig
from smartmesh_ros.patches.contact_candidates import Window
from smartmesh_ros.patches.facets import Point
from smartmesh_ros.patches.selection import window_memory
from smartmesh_ros.patches.selector import rules_for
from smartmesh_ros.patches.shapes import BODY_COLUMNS, BodyShape, box, solid_of
from smartmesh_ros.patches.shapes import ball as ball_shape
from smartmesh_ros.patches.solids import Solid, moved_by
from smartmesh_ros.physics.impact import (
    TOUCH,
    clamp_before_impact,
    clamped_path,
    height_at_rest,
    nearest_gap,
    out_of_ground,
    time_of_impact,
    without_closing,
)
from smartmesh_ros.terrain.heightmap import HeightMap
from tests.bodies import FORMS, Form, random_turn, rotation, shapes_of
from tests.examples import examples

SIDE = 24
SPACING = 0.1
ARRIVAL = 1e-4
X, Y, UP = Point(1.0, 0.0, 0.0), Point(0.0, 1.0, 0.0), Point(0.0, 0.0, 1.0)
RULES = rules_for(PatchConfig(), SELECTION, 0.0, across=False)

seeds = st.integers(0, 10**9)


def window_over(heights: np.ndarray) -> Window:
    return Window(np.ascontiguousarray(heights, float), np.zeros(heights.shape), SPACING)


def slope(rise: float) -> np.ndarray:
    """A plane that rises along x."""
    return np.tile(rise * SPACING * np.arange(SIDE), (SIDE, 1))


def ball(x: float, y: float, z: float, radius: float) -> Solid:
    return placed(ball_shape(radius), x, y, z, np.array([0.0, 0.0, 0.0, 1.0]))


def placed(shape: BodyShape, x: float, y: float, z: float, turn: np.ndarray) -> Solid:
    """The solid of a shape at a pose."""
    body = np.concatenate([[x, y, z], turn, np.zeros(6)])
    return solid_of(shapes_of([shape]), 0, body)


def cube(rng: np.random.Generator, x: float, y: float, z: float, half: float) -> Solid:
    return placed(box((2.0 * half,) * 3), x, y, z, random_turn(rng))


def gap_ahead(window: Window, solid: Solid, path: Point, least: float) -> Any:
    """The gap to what is nearest to a solid of all that it meets if it goes on."""
    return nearest_gap(window, solid, path, least, math.inf)


@given(st.floats(-1.0, 1.0), st.floats(0.01, 0.5), st.floats(-1.0, 1.0), st.floats(-1.5, -0.1))
def test_a_ball_meets_a_plane_where_geometry_says(rise: float, above: float, along: float, down: float) -> None:
    radius, normal = 0.1, np.array([-rise, 0.0, 1.0]) / math.hypot(rise, 1.0)
    start = np.array([1.15, 1.15, 1.15 * rise]) + (radius + above) * normal
    path = np.array([0.5 * along, 0.0, down])
    closing = -float(normal @ path)
    found = time_of_impact(window_over(slope(rise)), ball(*start, radius), Point(*path), 0.0)
    share = (above - TOUCH) / closing if closing > 0.0 else 2.0
    if share < 0.99:
        assert found.share == pytest.approx(share, abs=1.01 * TOUCH / closing)
        # Near an edge the ball may touch the next facet too, whose closest point is so far beside.
        tilt = math.sqrt(2.0 * TOUCH / radius)
        foot = (start + share * path - radius * normal) / SPACING
        edges = np.array([foot[0], foot[1], foot[0] - foot[1]])
        near = SPACING * np.abs(edges - np.rint(edges)).min() < 2.0 * radius * tilt
        np.testing.assert_allclose(found.normal, normal, atol=tilt if near else 1e-9)
    elif not share <= 1.01:
        assert found.share == 2.0


def test_who_moves_away_or_along_meets_nothing() -> None:
    window = window_over(slope(0.0))
    for path in (Point(0.0, 0.0, 1.0), Point(0.5, 0.2, 0.0)):
        assert time_of_impact(window, ball(1.0, 1.0, 0.101, 0.1), path, 0.0).share == 2.0
        for z in (0.05, 0.0999, 0.101, 0.3):  # in the ground from the start, or never
            assert clamped_path(window, out_of_ground(window, ball(1.0, 1.0, z, 0.1)), path, 0.0, ARRIVAL) == path


def test_the_solver_takes_away_what_closes_on_contacts() -> None:
    flat, steep = np.array([[0.0, 0.0, 1.0, 0.0]]), np.array([[0.6, 0.0, 0.8, 0.0]])
    assert without_closing(Point(1.0, 2.0, -3.0), flat, 1.0, 0.0) == Point(1.0, 2.0, 0.0)
    assert without_closing(Point(0.0, 0.0, 1.0), flat, 1.0, 0.0) == Point(0.0, 0.0, 1.0)
    # In a frame turned by a quarter the normal is (0, -0.6, 0.8).
    assert without_closing(Point(0.0, -1.0, 0.0), steep, 0.0, 1.0) == Point(0.0, -1.0, 0.0)
    turned = without_closing(Point(0.0, 1.0, -1.0), steep, 0.0, 1.0)
    assert -0.6 * turned.y + 0.8 * turned.z == pytest.approx(0.0, abs=1e-12)


def test_where_a_body_turns_about_a_contact_the_solver_takes_nothing_away() -> None:
    """A plank that stands on one end and falls: its centre comes down, the point that it stands on does not."""
    contact = np.array([[0.0, 0.0, 1.0, 0.5]])
    assert without_closing(Point(0.0, 0.0, -0.5), contact, 1.0, 0.0) == Point(0.0, 0.0, -0.5)


def test_over_a_hole_there_is_nothing_to_meet() -> None:
    heights = slope(0.0)
    heights[8:14, 8:14] = np.nan
    path = Point(0.0, 0.0, -1.0)
    assert time_of_impact(window_over(heights), ball(1.05, 1.05, 0.5, 0.1), path, 0.0).share == 2.0
    heights[11, 11] = 0.0  # a sample alone is no ground
    assert time_of_impact(window_over(heights), ball(1.05, 1.05, 0.5, 0.1), path, 0.0).share == 2.0


@examples(150)
@given(seeds, st.booleans(), st.booleans())
def test_before_its_impact_a_body_meets_nothing_and_at_it_something(seed: int, rough: bool, round_: bool) -> None:
    rng = np.random.default_rng(seed)
    heights = rng.normal(scale=0.05, size=(SIDE, SIDE)) if rough else slope(float(rng.normal(scale=0.5)))
    window = window_over(heights)
    radius = float(rng.uniform(0.03, 0.3))
    x, y = rng.uniform(0.6, 1.6, 2).tolist()
    top = float(heights.max()) + radius * (1.0 if round_ else math.sqrt(3.0))
    solid = ball(x, y, top + 0.01, radius) if round_ else cube(rng, x, y, top + 0.01, radius)
    path = Point(*rng.normal(scale=0.3, size=2).tolist(), -float(rng.uniform(0.2, 2.0)))
    found = time_of_impact(window, solid, path, 0.0)
    last = found.share if found.share <= 1.0 else 1.0
    for share in np.linspace(0.0, last, 40, endpoint=False):
        gap = gap_ahead(window, moved_by(solid, path, float(share)), path, 0.0)
        assert gap.distance >= -1e-9
    if found.share <= 1.0:
        gap = gap_ahead(window, moved_by(solid, path, found.share), path, 0.0)
        assert abs(gap.distance) <= 2.0 * ARRIVAL
        np.testing.assert_allclose(found.normal, gap.normal, atol=1e-9)


def grazing(seed: int, round_: bool) -> tuple[float, float, float]:
    """How deep in a plane a body ends that comes down a long shallow way, and how far it gets, and should, along it."""
    rng = np.random.default_rng(seed)
    rise, radius = float(rng.normal(scale=0.3)), 0.1
    normal = np.array([-rise, 0.0, 1.0]) / math.hypot(rise, 1.0)
    solid = ball(0.0, 0.0, 0.0, radius) if round_ else cube(rng, 0.0, 0.0, 0.0, radius)
    reach = radius
    if not round_:
        reach = radius * sum(abs(float(normal @ np.array(axis))) for axis in (solid.u, solid.v, solid.w))
    above = float(rng.uniform(1e-3, 0.02))
    centre = np.array([0.7, 1.15, 0.7 * rise]) + (reach + above) * normal
    solid = solid._replace(centre=Point(*centre.tolist()))
    along = np.array([1.0, 0.0, rise]) / math.hypot(rise, 1.0)
    path = float(rng.uniform(0.2, 0.8)) * along - 2.0 * above * normal
    cut = clamped_path(window_over(slope(rise)), solid, Point(*path.tolist()), 5.0 * ARRIVAL, ARRIVAL)
    return -above - float(normal @ np.array(cut)), float(along @ np.array(cut)), float(along @ path)


@examples(150)
@given(seeds, st.booleans())
@example(0, True)
def test_who_grazes_the_ground_fast_is_not_let_through(seed: int, round_: bool) -> None:
    depth, _, _ = grazing(seed, round_)
    assert depth <= 6.0 * ARRIVAL


def test_who_grazes_the_ground_fast_slides_on() -> None:
    for seed in range(50):
        _, way, expected = grazing(seed, True)
        assert way == pytest.approx(expected, abs=1e-2)


@examples(60)
@given(seeds)
@example(595)
def test_on_a_clamped_path_a_body_comes_no_deeper_than_its_arrival(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heights = 0.1 * np.sin(0.5 * np.arange(SIDE))[:, None] * np.cos(0.4 * np.arange(SIDE))
    window = window_over(heights)
    radius = float(rng.uniform(0.05, 0.2))
    x, y = rng.uniform(0.8, 1.4, 2).tolist()
    solid = ball(x, y, float(heights.max()) + radius + float(rng.uniform(1e-3, 0.1)), radius)
    path = Point(*rng.normal(scale=0.1, size=2).tolist(), -float(rng.uniform(0.2, 1.0)))
    shallow = 5.0 * ARRIVAL
    cut = clamped_path(window, solid, path, shallow, ARRIVAL)
    gap = gap_ahead(window, moved_by(solid, cut, 1.0), Point(0.0, 0.0, -1.0), 0.0)
    # It slides along one facet, and is stopped at the next; what it closes on by no more than that is left to others.
    assert gap.distance >= -2.0 * shallow


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_clamping_leaves_what_goes_along_the_ground_and_counts_its_motion(yaw: float) -> None:
    dt, speed = 1 / 240, 8.0
    heightmap = HeightMap(np.zeros((40, 40)), resolution=0.1, yaw=yaw, time=0.0)
    heightmap.replace(np.full((40, 40), 0.05), time=0.05)  # it rises at 1 m/s
    place = heightmap.geometry.to_world(20.3, 20.4)
    body = np.zeros(BODY_COLUMNS)
    body[:3], body[6], body[7:10] = (*place, 0.05 + 0.1 + 0.01), 1.0, (2.0, -1.0, -speed)
    change, memory = np.empty(3), window_memory(131)[:2]
    moved = clamp_before_impact(
        heightmap.moved_to(0.05),
        shapes_of([ball_shape(0.1)]),
        0,
        body,
        0.05,
        dt,
        np.zeros(3),
        5e-4,
        ARRIVAL,
        np.empty((0, 4)),
        RULES,
        *memory,
        change,
    )
    assert moved
    np.testing.assert_allclose(change[:2], 0.0, atol=1e-9)
    # It arrives where the ground will be.
    assert (speed - change[2]) * dt + 1.0 * dt == pytest.approx(0.01 + ARRIVAL, abs=1e-6)


def lift(heightmap: HeightMap, shape: BodyShape, body: np.ndarray) -> float:
    memory = window_memory(131)[:2]
    return float(height_at_rest(heightmap.moved_to(0.0), shapes_of([shape]), 0, body, 0.0, RULES, *memory))


def lying(form: Form, heightmap: HeightMap, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A body put onto the ground, and points of its surface (n, 3)."""
    body = np.zeros(BODY_COLUMNS)
    body[:2] = heightmap.geometry.to_world(*rng.uniform(15.0, 24.0, 2))
    body[2], body[3:7] = rng.normal(), random_turn(rng)
    body[2] += lift(heightmap, form.shape, body)
    surface = form.surface(rng, 20_000)
    return body, surface @ rotation(body[3:7]).T + body[:3]


def reach_of(form: Form, down: np.ndarray) -> float:
    """How far a form reaches along a direction from its body's centre."""
    own = rotation(form.turn).T @ down
    if form.tetrahedron:
        return float((form.corners @ down).max())
    if form.ball:
        reach = form.half[0]
    elif form.capsule:
        reach = form.half[0] + (form.half[2] - form.half[0]) * abs(own[2])
    elif form.round:
        reach = form.half[0] * math.hypot(own[0], own[1]) + form.half[2] * abs(own[2])
    else:
        reach = float(np.abs(own) @ form.half)
    return float(reach + down @ form.offset)


@examples(60)
@given(seeds, st.sampled_from(FORMS), st.floats(-3.0, 3.0))
def test_on_flat_ground_a_body_at_rest_touches_with_its_lowest_point(seed: int, name: str, yaw: float) -> None:
    rng = np.random.default_rng(seed)
    form = Form(name, 0.3, rng)
    heightmap = HeightMap(np.full((40, 40), 0.7), resolution=0.1, yaw=yaw)
    body, _ = lying(form, heightmap, rng)
    down = rotation(body[3:7]).T @ [0.0, 0.0, -1.0]
    lowest = body[2] - max(reach_of(part, down) for part in form.parts or [form])
    assert 0.7 - 1e-7 <= lowest <= 0.7 + 1e-4


@examples(60)
@given(seeds, st.sampled_from(FORMS), st.sampled_from(["rough", "steps", "pole"]))
def test_on_rough_ground_a_body_at_rest_is_in_it_nowhere_and_touches_it(seed: int, name: str, kind: str) -> None:
    rng = np.random.default_rng(seed)
    heights = rng.normal(scale=0.03, size=(40, 40)) if kind == "rough" else np.zeros((40, 40))
    if kind == "steps":
        heights[:, 20:] = 0.4
    elif kind == "pole":
        heights[19, 21] = 1.0
    heightmap, form = HeightMap(heights, resolution=0.1), Form(name, float(rng.choice([0.05, 0.3])), rng)
    body, points = lying(form, heightmap, rng)
    ground = heightmap.at(points[:, :2], 0.0).heights
    assert (points[:, 2] >= ground - 1e-6).all()
    # Let down by a little, the ground is in it: points of the ground, sampled densely, under all of it.
    reach = form.radius + 0.1
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.linspace(-reach, reach, 400) + body[axis] for axis in (0, 1))))
    below = np.column_stack([x, y, heightmap.at(np.column_stack([x, y]), 0.0).heights])
    corners = np.argwhere(np.ones((40, 40), bool))
    samples = np.column_stack([heightmap.geometry.to_world(*corners.T), heightmap.heights[tuple(corners.T)]])
    solid = np.concatenate([below, samples])
    turn = rotation(body[3:7])
    assert not form.inside(solid, body[:3] + [0.0, 0.0, 1e-6], turn).any()
    fine = 0.01 if kind == "rough" else 0.06  # what lies between the points
    assert form.inside(solid, body[:3] - [0.0, 0.0, fine], turn).any()


def test_where_there_is_no_ground_under_it_a_body_lies_nowhere() -> None:
    heights = np.zeros((40, 40))
    heights[10:30, 10:30] = np.nan
    body = np.zeros(BODY_COLUMNS)
    body[:3], body[6] = (2.0, 2.0, 1.0), 1.0
    assert math.isnan(lift(HeightMap(heights, resolution=0.1), ball_shape(0.3), body))
