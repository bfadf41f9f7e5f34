"""Distances of triangles from bodies against the library coal, and their depths."""

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.patches.shapes import MOST_GROWTH, BodyShape, ball, box, capsule, compound, cylinder, hull
from tests.bodies import foot_on, lowest_of, random_turn, rotation
from tests.core.contact_cases import IDENTITY, coal_hull, coal_triangle, distance, wheel
from tests.examples import examples

UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])
# Barycentric coordinates of points all over a triangle, STEP of its edges apart, corners and edges among them.
STEP = 1.0 / 48.0
SHARES = np.array([(i, j, 48 - i - j) for i in range(49) for j in range(49 - i)]) * STEP
# Half of the cell of a map.
CELL = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])

seeds = st.integers(0, 10**9)
Part = tuple[Any, np.ndarray, np.ndarray]  # a geometry of coal's, its offset and its turn


def gap_to(corners: np.ndarray, shape: BodyShape, position: np.ndarray, turn: np.ndarray) -> float:
    return float(foot_on(corners, shape, position, turn).gap)


def foot(support: Any) -> np.ndarray:
    return np.array([support.foot_x, support.foot_y, support.foot_z])


def triangle(rng: np.random.Generator, *, upright: bool = False) -> np.ndarray:
    """Corners (3, 3): cells of a map steep and flat, slivers, and triangles that stand anyhow."""
    corners = rng.normal(size=(3, 3))
    if not upright:
        corners = CELL.copy()
        corners[:, 2] = rng.normal(scale=rng.choice([1e-3, 0.3, 3.0]), size=3)
        if rng.random() < 0.5:
            corners = corners[:, [1, 0, 2]][[0, 2, 1]]
    return np.asarray(corners * rng.choice([0.05, 1.0, 5.0]))


@examples(100)
@given(seeds, st.booleans())
def test_the_foot_of_a_ball_is_on_the_triangle_and_no_point_is_closer(seed: int, upright: bool) -> None:
    rng = np.random.default_rng(seed)
    corners = triangle(rng, upright=upright)
    size = np.abs(corners - corners[0]).max()
    p = corners.mean(axis=0) + rng.normal(size=3) * size * rng.choice([0.1, 1.0, 5.0])
    support = foot_on(corners, ball(0.2), p, random_turn(rng))
    found = foot(support)
    shares = np.linalg.lstsq(np.vstack([corners.T, np.ones(3) * size]), np.append(found, size), rcond=None)[0]
    assert shares.min() >= -1e-9
    np.testing.assert_allclose(shares @ corners, found, atol=1e-9 * size)
    assert np.linalg.norm(found - p) <= np.linalg.norm(SHARES @ corners - p, axis=1).min() + 1e-12
    assert support.gap == pytest.approx(np.linalg.norm(found - p) - 0.2, abs=1e-12 + 1e-9 * size)


def test_a_ball_whose_centre_is_on_a_facet_is_as_deep_as_its_radius() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    support = foot_on(corners, ball(0.5), np.array([0.6, 0.2, 0.6]), UNTURNED)
    assert support.gap == pytest.approx(-0.5, abs=1e-12)
    found = (support.facet_x, support.facet_y, support.facet_z)
    np.testing.assert_allclose(found, np.array([-1.0, 0.0, 1.0]) / np.sqrt(2.0), atol=1e-12)


def separation(corners: np.ndarray, half: np.ndarray) -> float:
    """The largest signed distance of a triangle from a box along their 13 axes, in the box's frame."""
    edges = np.roll(corners, -1, axis=0) - corners
    axes = np.concatenate(
        [[np.cross(edges[0], edges[1])], np.eye(3), np.cross(edges[:, None], np.eye(3)).reshape(-1, 3)]
    )
    lengths = np.linalg.norm(axes, axis=1)
    axes = axes[lengths > 1e-6] / lengths[lengths > 1e-6, None]
    along, reach = axes @ corners.T, np.abs(axes) @ half
    return float(np.maximum(along.min(axis=1) - reach, -along.max(axis=1) - reach).max())


@examples(400)
@given(seeds, st.booleans())
def test_a_box_is_never_said_to_be_farther_than_it_is_and_its_depth_is_exact(seed: int, upright: bool) -> None:
    """And it is said to touch where it touches, and only there."""
    rng = np.random.default_rng(seed)
    corners = triangle(rng, upright=upright)
    turn = UNTURNED if rng.random() < 0.3 else random_turn(rng)
    size = np.abs(corners - corners.mean(axis=0)).max()
    half = size * np.exp(rng.uniform(-3.0, 1.0, 3))
    centre = corners.mean(axis=0) + rng.normal(size=3) * (size + half.max()) * rng.choice([0.3, 1.0])
    gap = gap_to(corners, box(2.0 * half), centre, turn)
    own = (SHARES @ corners - centre) @ rotation(turn)
    sampled = float(np.linalg.norm(np.maximum(np.abs(own) - half, 0.0), axis=1).min())
    assert gap <= sampled + 1e-12
    if gap <= 0.0:
        assert sampled <= 2.0 * STEP * size, "it says that they overlap"
        assert gap == pytest.approx(separation((corners - centre) @ rotation(turn), half), abs=1e-9 * (1.0 + size))


def simple(name: str, rng: np.random.Generator) -> tuple[BodyShape, Part]:
    a, b, c = (0.2 * np.exp(rng.uniform(-1.5, 0.5, 3))).tolist()
    offset, turn = rng.normal(scale=0.1, size=3), random_turn(rng)
    if name == "ball":
        return ball(a, offset), (coal.Sphere(a), offset, turn)
    if name == "capsule":
        return capsule(a, b, offset, turn), (coal.Capsule(a, b), offset, turn)
    if name == "box":
        return box((a, b, c), offset, turn), (coal.Box(a, b, c), offset, turn)
    if name == "cylinder":
        return cylinder(a, b, offset, turn), (coal.Cylinder(a, b), offset, turn)
    points = wheel(a, 0.5 * a) if name == "wheel" else rng.normal(size=(int(rng.integers(4, 40)), 3)) * (a, b, c)
    placed = points @ rotation(turn).T + offset
    return hull(placed), (coal_hull(points), offset, turn)


def shape_named(name: str, rng: np.random.Generator) -> tuple[BodyShape, list[Part]]:
    if name != "compound":
        made, part = simple(name, rng)
        return made, [part]
    made_parts = [simple(kind, rng) for kind in ("box", "ball", "hull", "cylinder")]
    return compound([made for made, _ in made_parts]), [part for _, part in made_parts]


SHAPES = ("ball", "capsule", "box", "cylinder", "wheel", "hull", "compound")


def true_distance(parts: list[Part], position: np.ndarray, turn: np.ndarray) -> Callable[[np.ndarray], float]:
    """Returns a function that gives the distance of a triangle (3, 3) from a shape, zero or less if they overlap."""
    axes = rotation(turn)
    poses = [coal.Transform3s(axes @ rotation(q), axes @ offset + position) for _, offset, q in parts]

    def found(corners: np.ndarray) -> float:
        one = coal_triangle(corners)
        return min(distance(one, IDENTITY, part[0], pose) for part, pose in zip(parts, poses, strict=True))

    return found


@examples(150)
@given(seeds, st.sampled_from(SHAPES))
def test_the_gap_is_the_distance(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    made, parts = shape_named(name, rng)
    position, turn = rng.normal(scale=0.2, size=3), random_turn(rng)
    true = true_distance(parts, position, turn)
    for _ in range(10):
        corners = rng.normal(size=3) * 0.3 + rng.normal(size=(3, 3)) * rng.choice([0.03, 0.3])
        truth, gap = true(corners), gap_to(corners, made, position, turn)
        if truth > 1e-6:
            assert gap == pytest.approx(truth, abs=1e-5)
        else:
            assert gap <= 2e-6


def test_a_hull_of_many_vertices_is_replaced_by_one_of_fewer_that_holds_it() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(10_000, 3))
    points *= (0.3, 0.2, 0.1) / np.linalg.norm(points, axis=1)[:, None]
    made = hull(points)
    assert len(made.vertices) <= 2048
    growth = float(made.record["rounding"])
    assert 0.0 < growth <= MOST_GROWTH
    reduced = coal_hull(made.vertices + made.record["offset"])
    for point in points[:300]:
        away = distance(coal.Sphere(1e-9), coal.Transform3s(np.eye(3), point), reduced, IDENTITY)
        assert away <= growth + 1e-6
    few = hull(points[:40])
    assert len(few.vertices) == 40
    assert few.record["rounding"] == 0.0


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_hulls_without_volume_have_distances(count: int) -> None:
    """A point, a line, a triangle, a square."""
    corners = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]])[:count]
    facet = np.array([[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]])
    support = foot_on(facet, hull(corners), np.zeros(3), UNTURNED)
    assert support.gap == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose((support.facet_x, support.facet_y, support.facet_z), (0.0, 0.0, 1.0), atol=1e-5)


@examples(100)
@given(seeds, st.sampled_from(SHAPES))
def test_the_nearest_of_many_triangles_is_that_of_the_smallest_gap(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    (made, _), turn = shape_named(name, rng), random_turn(rng)
    corners = rng.normal(size=(40, 1, 3)) * 0.5 + rng.normal(size=(40, 3, 3)) * 0.1
    gaps = [gap_to(each, made, np.zeros(3), turn) for each in corners]
    # Distances of the foot from the centre break ties; they weigh a millionth.
    assert gap_to(corners, made, np.zeros(3), turn) == pytest.approx(min(gaps), abs=5e-6)


@examples(100)
@given(seeds, st.sampled_from(SHAPES))
def test_a_body_reaches_as_far_down_as_its_distance_from_a_floor_says(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    made, parts = shape_named(name, rng)
    position, turn = rng.normal(scale=0.2, size=3), random_turn(rng)
    floor = np.array([[-20.0, -20.0, -3.0], [20.0, -20.0, -3.0], [0.0, 30.0, -3.0]])
    lowest = lowest_of(made, position, turn)
    assert lowest == pytest.approx(true_distance(parts, position, turn)(floor) - 3.0, abs=1e-5)
    assert lowest >= position[2] - made.radius - 1e-9
