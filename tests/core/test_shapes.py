"""Shapes of bodies against the library coal."""

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.patches.shapes import MOST_GROWTH, BodyShape, ball, box, capsule, compound, cylinder, hull
from tests.bodies import lowest_of, random_turn, rotation
from tests.core.contact_cases import IDENTITY, coal_hull, coal_triangle, distance, wheel
from tests.examples import examples

seeds = st.integers(0, 10**9)
Part = tuple[Any, np.ndarray, np.ndarray]  # a geometry of coal's, its offset and its turn


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
