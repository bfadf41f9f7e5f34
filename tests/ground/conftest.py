"""Fixtures of the tests of the ground."""

from collections.abc import Iterator
from typing import Any

import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient


@pytest.fixture
def client() -> Iterator[Any]:
    """A PyBullet world with gravity, and nothing in it."""
    bullet = BulletClient(pb.DIRECT)
    bullet.setGravity(0.0, 0.0, -9.81)
    yield bullet
    bullet.disconnect()
