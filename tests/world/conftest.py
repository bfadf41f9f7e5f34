"""Fixtures of the tests of worlds."""

from collections.abc import Iterator

import numpy as np
import pytest

from smartmesh_ros import HeightMap, World


@pytest.fixture
def world() -> Iterator[World]:
    """A world on level ground of 10 m, around the origin."""
    with World(HeightMap(np.zeros((101, 101)), resolution=0.1, origin=(-5.0, -5.0))) as made:
        yield made
