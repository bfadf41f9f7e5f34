"""Shapes of bodies against their points and the library coal."""

from itertools import product

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.world.robots.hull_vertices import MOST_OUTSIDE, fewer_vertices
from tests.bodies import lowest_of, random_turn, rotation
from tests.core.contact_cases import IDENTITY, coal_hull, distance, wheel
from tests.examples import examples

seeds = st.integers(0, 10**9)
Part = tuple[BodyShape, np.ndarray, float]  # a shape, points of its frame, and the radius that grows their hull to it
SHAPES = ("ball", "capsule", "box", "cylinder", "wheel", "hull", "compound")
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))


def part(name: str, rng: np.random.Generator) -> Part:
    a, b, c = (0.2 * np.exp(rng.uniform(-1.5, 0.5, 3))).tolist()
    offset, turn = rng.normal(scale=0.1, size=3), random_turn(rng)
    points = {
        "ball": np.zeros((1, 3)), "capsule": np.array([(0.0, 0.0, 0.5 * b), (0.0, 0.0, -0.5 * b)]),
        "box": CORNERS * (a, b, c), "cylinder": wheel(a, b, 2000), "wheel": wheel(a, 0.5 * a),
        "hull": rng.normal(size=(int(rng.integers(4, 40)), 3)) * (a, b, c),
    }[name] @ rotation(turn).T + offset  # fmt: skip
    if name == "ball":
        return BodyShape.ball(a, offset), points, a
    if name == "capsule":
        return BodyShape.capsule(a, b, offset, turn), points, a
    if name == "box":
        return BodyShape.box((a, b, c), offset, turn), points, 0.0
    return BodyShape.cylinder(a, b, offset, turn) if name == "cylinder" else BodyShape.hull(points), points, 0.0


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


@examples(100)
@given(seeds, st.sampled_from(SHAPES))
def test_a_body_reaches_as_far_down_as_its_points(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    parts = [part(kind, rng) for kind in (("box", "ball", "hull", "cylinder") if name == "compound" else (name,))]
    made = BodyShape.compound([shape for shape, *_ in parts]) if name == "compound" else parts[0][0]
    position, turn = rng.normal(scale=0.2, size=3), random_turn(rng)
    lowest = lowest_of(made, position, turn)
    lows = [float((points @ rotation(turn)[2]).min()) - radius for _, points, radius in parts]
    assert lowest == pytest.approx(position[2] + min(lows), abs=1e-5)
    assert lowest >= position[2] - made.radius - 1e-9
