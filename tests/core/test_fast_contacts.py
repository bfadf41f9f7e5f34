"""What a shape may touch in a step is bounded by its size and its way, however fast it spins."""

import numpy as np
import pytest

from smartmesh_ros import HeightMap
from tests.core.contact_cases import SHAPES, body, contacts_of, random_rotation

DURATION, MARGIN = 1.0 / 240.0, 1e-3  # of a step [s], up to which contacts are looked for beside the motion [m]
ROUGH = HeightMap(np.random.default_rng(0).normal(scale=0.02, size=(121, 121)), resolution=0.1)
CELL = 0.17  # diameter of the balls around cells [m]


@pytest.mark.parametrize("spin", [30.0, 1e3, 1e5])
@pytest.mark.parametrize("name", SHAPES)
def test_what_spins_touches_nothing_farther_away_than_it_is_large(name: str, spin: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        shape, axis = body(name, 0.3, rng), rng.normal(size=3)
        at = np.array([6.0, 6.0, rng.uniform(0.5, 1.0) * shape.reach])
        motion = np.zeros(3), axis * (spin / np.linalg.norm(axis))
        contacts = contacts_of(shape.core, ROUGH, random_rotation(rng), at, MARGIN, motion, DURATION)
        assert np.all(np.linalg.norm(contacts[:, :3] - at, axis=1) <= 2.0 * shape.reach + MARGIN + CELL)
