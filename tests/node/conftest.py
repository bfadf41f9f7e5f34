"""Fixtures of the tests over DDS."""

import os

import pytest

from smartmesh_ros.testing import domain, probe

__all__ = ["domain", "probe"]


@pytest.fixture
def no_shared_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Messages by UDP only, for tests that kill a peer: Fast DDS 2.14 may crash when a participant that shared memory
    with a killed one ends (in ``SharedMemChannelResource::release``), which would be that of the tests. Ask for it
    before the probe."""
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")


@pytest.fixture
def bare_environment() -> dict[str, str]:
    """Changes of the environment that make it one of a machine with only what the node needs installed."""
    return {
        name: os.pathsep.join(part for part in value.split(os.pathsep) if "test_interfaces" not in part)
        for name, value in os.environ.items()
        if "test_interfaces" in value
    }
