"""Holes of a field: nothing is held up over them, and their rims hold what stands on them."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, Sphere
from smartmesh_ros.core import _core
from smartmesh_ros.ground.shapes import Shape
from tests.bodies import LYING
from tests.core.contact_cases import random_rotation
from tests.grounds import end_of, shaped

# Which samples at x, y [m] are no ground.
Hole = Callable[[np.ndarray, np.ndarray], np.ndarray]


HOLES: dict[str, Hole] = {
    "from x = 0 on": lambda x, y: x > 0.01,
    "slot": lambda x, y: (x > 0.01) & (x < 0.99) & (abs(y) < 0.29),  # 0.6 m wide, but for a facet in each corner
    "pit": lambda x, y: (abs(x) < 0.19) & (abs(y) < 0.19),  # 0.4 m wide
    "trench": lambda x, y: abs(x) < 0.09,  # 0.2 m wide
}
# What stands where, and the height of its middle at rest [m]; NaN = it falls in.
BOX, WHEEL = Box(0.6, 0.36, 0.3), Cylinder(radius=0.2, height=0.3)
CASES: dict[str, tuple[str, Shape, BodyState, float]] = {
    "box over a slot, between two rims": ("slot", BOX, BodyState((0.08, 0.0, 0.15)), math.nan),
    "box before a slot": ("slot", BOX, BodyState((-0.08, 0.0, 0.15)), 0.15),
    "box longer than a trench is wide": ("trench", BOX, BodyState((0.01, 0.0, 0.15)), 0.15),
    "ball in a pit": ("pit", Sphere(0.3), BodyState((0.01, 0.01, 0.3)), math.sqrt(0.3**2 - 0.2**2)),
    "wheel in a trench": ("trench", WHEEL, BodyState((0.01, 0.013, 0.2), LYING), math.sqrt(0.2**2 - 0.1**2)),
    "wheel over the rim": ("from x = 0 on", WHEEL, BodyState((0.03, 0.013, 0.2), LYING), math.nan),
}


@pytest.mark.parametrize("name", ["ball", "box", "capsule"])
def test_neighbours_that_share_no_facet_are_apart(name: str) -> None:
    """Two parts of a map meet at one sample each: the contacts with both are those with each of them alone."""
    rng, still, touched = np.random.default_rng(len(name)), np.zeros((2, 3)), 0
    ball, box = _core.Shape.ball(0.2), _core.Shape.box(0.2, 0.1, 0.05)
    shape = {"ball": ball, "box": box, "capsule": _core.Shape.capsule(0.1, 0.2)}[name]
    rows, columns = np.mgrid[:12, :12]
    for _ in range(200):
        heights = rng.normal(scale=0.02, size=(12, 12))
        heights[(rows == 5) & (columns != 5) | (rows == 6) & (columns != 5 + rng.integers(2))] = np.nan
        pose = np.vstack([random_rotation(rng), (*rng.uniform(0.4, 0.7, 2), rng.uniform(0.1, 0.25))])
        found = []
        for part in (rows >= 0, rows < 6, rows >= 6):
            tile = HeightMap(np.where(part, heights, np.nan), resolution=0.1, origin=(0.0, 0.0)).core_reader
            contacts = np.asarray(_core.find_contacts(shape, [tile], pose, still, 1.0 / 240.0, 1e-2))
            found.append(sorted(contacts.tolist()))
        touched += len(found[0])
        assert found[0] == sorted(found[1] + found[2])
    assert touched > 100


@pytest.mark.parametrize("name", CASES)
def test_rims_hold_what_stands_on_them_and_holes_nothing(name: str) -> None:
    """For 2 s on level ground with a hole."""
    hole, shape, start, rest = CASES[name]
    height = end_of(shaped(lambda x, y: np.where(HOLES[hole](x, y), np.nan, 0.0), 61), shape, start, 480).position[2]
    assert height < -1.0 if math.isnan(rest) else height == pytest.approx(rest, abs=2e-3)
