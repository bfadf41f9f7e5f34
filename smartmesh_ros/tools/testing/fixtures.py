"""Pytest fixtures: a DDS domain for the session, and a probe for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from smartmesh_ros.startup.dds import isolated
from smartmesh_ros.tools.testing.probe import Probe

# The domain of the session. If several modules import a fixture, pytest makes one for each of them.
DOMAIN = pytest.StashKey[int]()


@pytest.fixture(scope="session")
def domain(pytestconfig: pytest.Config) -> Iterator[int]:
    """A DDS domain that nothing else on this machine uses, limited to this machine; one for the whole session, also if
    several modules import this fixture."""
    if DOMAIN in pytestconfig.stash:
        yield pytestconfig.stash[DOMAIN]
        return
    with isolated() as number:
        pytestconfig.stash[DOMAIN] = number
        yield number


@pytest.fixture
def probe(domain: int) -> Iterator[Probe]:
    """A probe in the test's domain."""
    with Probe() as made:
        yield made
