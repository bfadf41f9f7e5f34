"""Distances of triangles from shapes against the library coal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.patches.facets import Facet, Point
from smartmesh_ros.patches.gaps import gap_to
from smartmesh_ros.patches.shapes import MOST_GROWTH, BodyShape, ball, box, capsule, compound, cylinder, hull, solid_of
from tests.bodies import random_turn, rotation, shapes_of
from tests.coal_shapes import coal_hull, coal_triangle
from tests.examples import examples

IDENTITY = coal.Transform3s(np.eye(3), np.zeros(3))

seeds = st.integers(0, 10**9)
Part = tuple[Any, np.ndarray, np.ndarray]  # a geometry of coal's, its offset and its turn


def wheel(radius: float, width: float) -> np.ndarray:
    """A cylinder as a hull of 64 vertices, which is what PyBullet makes of one."""
    angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return np.concatenate([np.column_stack([rim, np.full(32, z)]) for z in (-0.5 * width, 0.5 * width)])


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

    def distance(corners: np.ndarray) -> float:
        one = coal_triangle(corners)
        return float(
            min(
                coal.distance(one, IDENTITY, part[0], pose, coal.DistanceRequest(), coal.DistanceResult())
                for part, pose in zip(parts, poses, strict=True)
            )
        )

    return distance


def as_facet(corners: np.ndarray) -> Facet:
    return Facet(*(Point(*corner) for corner in corners.tolist()))


@examples(150)
@given(seeds, st.sampled_from(SHAPES))
def test_the_gap_is_the_distance(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    made, parts = shape_named(name, rng)
    position, turn = rng.normal(scale=0.2, size=3), random_turn(rng)
    solid = solid_of(shapes_of([made]), 0, np.concatenate([position, turn, np.zeros(6)]))
    distance = true_distance(parts, position, turn)
    for _ in range(10):
        corners = rng.normal(size=3) * 0.3 + rng.normal(size=(3, 3)) * rng.choice([0.03, 0.3])
        truth, gap = distance(corners), gap_to(as_facet(corners), solid).distance
        if truth > 1e-6:
            assert gap == pytest.approx(truth, abs=1e-5)
        else:
            assert gap <= 2e-6


def test_a_hull_of_many_vertices_is_replaced_by_one_of_fewer_that_holds_it() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(10_000, 3))
    points *= (0.3, 0.2, 0.1) / np.linalg.norm(points, axis=1)[:, None]
    made = hull(points)
    assert made.vertices is not None
    assert len(made.vertices) <= 2048
    growth = float(made.record["rounding"])
    assert 0.0 < growth <= MOST_GROWTH
    reduced = coal_hull(made.vertices + made.record["offset"])
    for point in points[:300]:
        away = coal.distance(
            coal.Sphere(1e-9), coal.Transform3s(np.eye(3), point), reduced, IDENTITY, coal.DistanceRequest(),
            coal.DistanceResult(),
        )  # fmt: skip
        assert away <= growth + 1e-6
    few = hull(points[:40])
    assert few.vertices is not None
    assert len(few.vertices) == 40
    assert few.record["rounding"] == 0.0


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_hulls_without_volume_have_distances(count: int) -> None:
    """A point, a line, a triangle, a square."""
    corners = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]])[:count]
    solid = solid_of(shapes_of([hull(corners)]), 0, np.array([0.0] * 6 + [1.0] + [0.0] * 6))
    facet = as_facet(np.array([[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]]))
    gap = gap_to(facet, solid)
    assert gap.distance == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(gap.normal, (0.0, 0.0, 1.0), atol=1e-5)
