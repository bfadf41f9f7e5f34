"""Fixtures of the tests over DDS."""

from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest

from smartmesh_ros.tools.testing import Probe, Process, domain, probe
from smartmesh_ros.tools.testing.probe import DIAGNOSTICS
from smartmesh_ros.tools.testing.process import start_command
from tests.node.shared import clear

__all__ = ["domain", "probe"]


# Changes of the environment with which a node sends by UDP within this machine, and shares no memory.
UDP_ONLY = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).parent / "udp_only.xml"),
    # With LOCALHOST, rmw_fastrtps adds shared memory to any profile, and ignores FASTDDS_BUILTIN_TRANSPORTS.
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
}


@pytest.fixture
def udp_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes share no memory with the tests, for tests that kill a node: Fast DDS 2.14 may crash when a participant ends
    that shared memory with a killed one (in ``SharedMemChannelResource::release``), here that of the tests."""
    start = Process.starter

    def start_udp_only(command: list[str], log: IO[bytes], environment: dict[str, str]) -> Any:
        return start(command, log, environment | UDP_ONLY)

    monkeypatch.setattr(Process, "starter", staticmethod(start_udp_only))


@pytest.fixture
def executables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes are started by their executables, for tests of the start and the end; see `tests.preloaded`."""
    monkeypatch.setattr(Process, "starter", staticmethod(start_command))


@pytest.fixture(scope="module")
def shared_node(domain: int, request: pytest.FixtureRequest) -> Iterator[tuple[Probe, Process]]:
    """A node with the parameters ``SHARED`` of the module, if it has any, and a probe of it, in a namespace of their
    own: nodes that single tests start beside it do not disturb it, nor it them."""
    with Probe("shared") as made, made.running(parameters=getattr(request.module, "SHARED", None)) as process:
        yield made, process


@pytest.fixture
def shared(shared_node: tuple[Probe, Process]) -> Iterator[Probe]:
    """The probe of the module's shared node, for tests that need neither parameters nor an end of their own: without
    bodies and terrain, and running."""
    made, process = shared_node
    assert process.process.poll() is None, f"it ended in an earlier test: {process.output}"
    yield made
    if process.process.poll() is None:
        clear(made)
    for topic in set(made.received) - {DIAGNOSTICS}:  # those say whom the node is connected to
        made.received[topic].clear()
