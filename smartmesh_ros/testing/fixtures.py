"""Pytest fixtures: a DDS domain for the session, and a probe for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from smartmesh_ros.startup.domains import isolated
from smartmesh_ros.testing.probe import Probe


@pytest.fixture(scope="session")
def domain() -> Iterator[int]:
    """A DDS domain that nothing else on this machine uses, limited to this machine."""
    with isolated() as number:
        yield number


@pytest.fixture
def probe(domain: int) -> Iterator[Probe]:
    """A probe in the test's domain."""
    with Probe() as made:
        yield made
