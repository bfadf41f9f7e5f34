"""Contacts of shapes that touch level ground with holes."""

import numpy as np
import pytest

from smartmesh_ros import HeightMap
from smartmesh_ros.core.body_shape import BodyShape
from tests.bodies import rotation
from tests.core.contact_cases import contacts_of, random_rotation, wheel

RESOLUTION, DEPTH, MARGIN = 0.05, 1e-4, 1e-3
# Names of the edges of a body, and of the line along the side of a cylinder.
EDGES, SIDE_LINE = 3 << 24, (5 << 24) + 1


@pytest.mark.parametrize("kind", ["ball", "capsule", "box", "cylinder", "hull"])
def test_no_contact_is_deeper_than_the_way_up(kind: str) -> None:
    """A shape whose lowest point is 0.1 mm below the ground is out of it as soon as it is lifted by as much, wherever
    the edges of the holes are: beyond the top of its wall, an edge is not there."""
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        heights = np.where(rng.random((24, 24)) < rng.choice([0.05, 0.15, 0.4]), np.nan, 0.0)
        a, b, c = (RESOLUTION * rng.uniform(0.2, 2.5, 3)).tolist()
        turn = random_rotation(rng)
        if rng.random() < 0.5:  # it lies or stands
            leaning = np.linalg.qr(np.eye(3) + 0.1 * rng.normal(size=(3, 3)))[0]
            turn = np.ascontiguousarray(leaning * np.linalg.det(leaning)) @ np.eye(3)[:, rng.permutation(3)]
            turn = np.ascontiguousarray(turn * np.linalg.det(turn))
        rim = wheel(a, 2.0 * b, 12)
        across, along = np.hypot(turn[2, 0], turn[2, 1]), abs(turn[2, 2])
        shape, low = {
            "ball": (BodyShape.ball(a), a),
            "capsule": (BodyShape.capsule(a, 2.0 * b), a + b * along),
            "box": (BodyShape.box((2.0 * a, 2.0 * b, 2.0 * c)), float(np.abs(turn[2]) @ [a, b, c])),
            "cylinder": (BodyShape.cylinder(a, 2.0 * b), a * across + b * along),
            "hull": (BodyShape.hull(rim, 0.0), -float((rim @ turn[2]).min())),
        }[kind]
        at = (*rng.uniform(0.4, 0.75, 2), low - DEPTH)
        motion = rng.normal(size=(2, 3)) * rng.choice([0.0, 1.0, 3.0])
        found = contacts_of(shape, HeightMap(heights, resolution=RESOLUTION), turn, at, MARGIN, motion)
        assert np.all(found[:, 6] > -2.1 * DEPTH), seed


@pytest.mark.parametrize("kind", ["capsule", "box", "cylinder"])
def test_no_edge_overlaps_a_shape_by_more_than_its_width(kind: str) -> None:
    """On the steep sides of a shaft, many edges lie beside the shape, and are none of its crests."""
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        heights = rng.normal(scale=0.1, size=(9, 9))
        heights[4, 4] = np.nan
        a, b, c = rng.uniform(0.02, 0.15, 3).tolist()
        turn = random_rotation(rng)
        shape, half, rounding = {
            "capsule": (BodyShape.capsule(a, 2.0 * b), np.array([0.0, 0.0, b]), a),
            "box": (BodyShape.box((2.0 * a, 2.0 * b, 2.0 * c)), np.array([a, b, c]), 0.0),
            "cylinder": (BodyShape.cylinder(a, 2.0 * b), np.array([a, 0.0, b]), 0.0),
        }[kind]
        at = (*rng.uniform(0.35, 0.45, 2), rng.uniform(-0.2, 0.1))
        found = contacts_of(shape, HeightMap(heights, resolution=0.1), turn, at, MARGIN)
        edges = found[np.isin(found[:, 7].astype(np.int64), [EDGES + k for k in range(12)] + [SIDE_LINE])]
        normals = edges[:, 3:6] @ turn
        if kind == "cylinder":
            normals = np.column_stack([np.hypot(normals[:, 0], normals[:, 1]), 0.0 * normals[:, 0], normals[:, 2]])
        assert np.all(edges[:, 6] > -2.0 * (np.abs(normals) @ half + rounding) - DEPTH), seed


def test_an_edge_across_the_inner_corner_of_a_rim_is_touched() -> None:
    """The edge of a box is 5 mm below the sample in the corner, where an edge of the ground ends at the hole."""
    heights = np.array([[-0.063, 0.02, 0.026], [0.006, -0.011, 0.046], [-0.005, -0.029, np.nan]])
    ground = HeightMap(heights, resolution=0.1, origin=(0.5, 0.6))
    turn = rotation((-0.226327, 0.562851, 0.689046, -0.396472))
    found = contacts_of(BodyShape.box((0.3, 0.3, 0.3)), ground, turn, (0.49722, 0.737049, 0.174088), MARGIN)
    assert found[:, 6].min(initial=0.0) == pytest.approx(-0.005, abs=1e-3)


@pytest.mark.parametrize(
    ("shape", "turn", "at", "heights"),
    [
        (BodyShape.box((0.354, 0.278, 0.346)), (0.1391, 0.9005, 0.1681, -0.3762), (-0.023, -0.079, 0.18),
         [[-0.083, np.nan, -0.045], [0.015, -0.048, 0.022], [-0.034, np.nan, -0.026]]),
        (BodyShape.cylinder(0.175, 0.264), (-0.2209, 0.2869, -0.2079, 0.9087), (-0.039, -0.017, 0.208),
         [[0.045, -0.054, 0.05], [-0.027, 0.003, 0.005], [-0.009, -0.081, -0.007]]),
    ],
    ids=["box between two holes", "cylinder on slopes"],
)  # fmt: skip
def test_edges_that_end_inside_a_shape_in_a_valley_are_touched(
    shape: object, turn: tuple[float, float, float, float], at: tuple[float, ...], heights: list[list[float]]
) -> None:
    """The sample in the middle is 5 mm inside. All lines of the shape cross the edges of the ground beyond it."""
    ground = HeightMap(np.array(heights), resolution=0.1, origin=(-0.1, -0.1))
    assert contacts_of(shape, ground, rotation(turn), at, MARGIN)[:, 6].min(initial=0.0) < -4e-3
