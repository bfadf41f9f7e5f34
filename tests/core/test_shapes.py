"""Shapes of bodies against the library coal."""

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.world.robots.hull_vertices import MOST_OUTSIDE, fewer_vertices
from tests.bodies import lowest_of, random_turn, rotation
from tests.core.contact_cases import IDENTITY, coal_hull, coal_triangle, distance, wheel
from tests.examples import examples

seeds = st.integers(0, 10**9)
Part = tuple[Any, np.ndarray, np.ndarray]  # a geometry of coal's, its offset and its turn


def simple(name: str, rng: np.random.Generator) -> tuple[BodyShape, Part]:
    a, b, c = (0.2 * np.exp(rng.uniform(-1.5, 0.5, 3))).tolist()
    offset, turn = rng.normal(scale=0.1, size=3), random_turn(rng)
    if name == "ball":
        return BodyShape.ball(a, offset), (coal.Sphere(a), offset, turn)
    if name == "capsule":
        return BodyShape.capsule(a, b, offset, turn), (coal.Capsule(a, b), offset, turn)
    if name == "box":
        return BodyShape.box((a, b, c), offset, turn), (coal.Box(a, b, c), offset, turn)
    if name == "cylinder":
        return BodyShape.cylinder(a, b, offset, turn), (coal.Cylinder(a, b), offset, turn)
    points = wheel(a, 0.5 * a) if name == "wheel" else rng.normal(size=(int(rng.integers(4, 40)), 3)) * (a, b, c)
    placed = points @ rotation(turn).T + offset
    return BodyShape.hull(placed), (coal_hull(points), offset, turn)


def shape_named(name: str, rng: np.random.Generator) -> tuple[BodyShape, list[Part]]:
    if name != "compound":
        made, part = simple(name, rng)
        return made, [part]
    made_parts = [simple(kind, rng) for kind in ("box", "ball", "hull", "cylinder")]
    return BodyShape.compound([made for made, _ in made_parts]), [part for _, part in made_parts]


SHAPES = ("ball", "capsule", "box", "cylinder", "wheel", "hull", "compound")


def true_distance(parts: list[Part], position: np.ndarray, turn: np.ndarray) -> Callable[[np.ndarray], float]:
    """Returns a function that gives the distance of a triangle (3, 3) from a shape, zero or less if they overlap."""
    axes = rotation(turn)
    poses = [coal.Transform3s(axes @ rotation(q), axes @ offset + position) for _, offset, q in parts]

    def found(corners: np.ndarray) -> float:
        one = coal_triangle(corners)
        return min(distance(one, IDENTITY, part[0], pose) for part, pose in zip(parts, poses, strict=True))

    return found


def test_few_vertices_of_a_hull_hold_the_others_but_for_a_millimetre() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(10_000, 3))
    points *= (0.3, 0.2, 0.1) / np.linalg.norm(points, axis=1)[:, None]
    kept = fewer_vertices(points, 64)
    assert len(kept) <= 2048
    reduced = coal_hull(kept)
    for point in points[:300]:
        away = distance(coal.Sphere(1e-9), coal.Transform3s(np.eye(3), point), reduced, IDENTITY)
        assert away <= MOST_OUTSIDE + 1e-6
    assert len(fewer_vertices(points[:40], 64)) == 40


def test_few_vertices_of_a_disc_hold_the_others() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    kept = fewer_vertices(np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles]), 8)
    around = np.sort(np.arctan2(kept[:, 1], kept[:, 0]))
    assert 1.0 - np.cos(0.5 * np.diff(around).max()) <= MOST_OUTSIDE


@examples(50)
@given(seeds)
def test_distances_from_a_hull_are_those_of_coal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kept, points = rng.normal(size=(int(rng.integers(4, 30)), 3)), rng.normal(scale=1.5, size=(20, 3))
    found = CORE.distances_outside(kept, points)
    for point, away in zip(points, found, strict=True):
        true = distance(coal.Sphere(1e-9), coal.Transform3s(np.eye(3), point), coal_hull(kept), IDENTITY)
        assert away == pytest.approx(max(true, 0.0), abs=1e-5)


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
