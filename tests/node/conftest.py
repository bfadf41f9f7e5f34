"""Fixtures of the tests of nodes."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from time import monotonic
from typing import IO, Any

import numpy as np
import pytest
from smartmesh_msgs.srv import RemoveBodies
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.node.timing.pacing import NodeClock
from smartmesh_ros.tools.testing import Probe, Process, domain, probe
from smartmesh_ros.tools.testing.probe import DIAGNOSTICS
from smartmesh_ros.tools.testing.process import start_command
from tests.node.shared import Log, Logged, body_names

__all__ = ["domain", "probe"]


# Changes of the environment with which a node sends by UDP within this machine, and shares no memory.
UDP_ONLY = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).parent / "udp_only.xml"),
    # With LOCALHOST, rmw_fastrtps adds shared memory to any profile, and ignores FASTDDS_BUILTIN_TRANSPORTS.
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
}


@pytest.fixture(autouse=True)
def _isolated(domain: int) -> None:
    """No node of these tests, in whichever process, is heard in another domain."""


@pytest.fixture
def logged(capfd: pytest.CaptureFixture[str]) -> Logged:
    """What nodes of this process have logged since the last call."""
    return lambda: capfd.readouterr().err


@pytest.fixture(name="now")
def own_time(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time [s] by which nodes of this process run, measure and compare stamps."""
    now = [1000.0]
    for name in ("pace", "stamp_now", "steady"):
        monkeypatch.setattr(NodeClock, name, lambda _: now[0])
    return now


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


# What is still there is taken away again after so long [s], longer than bodies are tracked by default.
AGAIN = 1.5
NOTHING = {"simulated": "0", "tracked": "0", "patches": "0"}


def clear(probe: Probe) -> None:
    """Takes all bodies and all terrain away, sets the node's time to zero and lets it run, until the node says so.
    Parameters and counts of what was refused stay as they are."""
    assert probe.call("pause", SetBool, data=False).success
    asked: set[str] = set()

    def take_away(terrain: Mapping[str, str]) -> None:
        probe.publish_bodies({})
        probe.publish_poses([])
        if names := body_names(probe):
            probe.call("remove_bodies", RemoveBodies, ids=names)
        tiles = {found[1] for key in terrain if (found := re.fullmatch(r"size of '(.*)'", key))}
        for name in tiles - asked:  # one that is gone already would be refused, and counted
            asked.add(name)
            probe.publish_map(np.zeros((0, 0)), tile=name)
        assert probe.call("reset", Trigger).success  # stamps too: the last test may have set them ahead

    def empty() -> bool:
        nonlocal due
        found = probe.diagnostics_by_task()
        if found["terrain"]["tiles"] == "0" and NOTHING.items() <= found["bodies"].items():
            return True
        if monotonic() >= due:  # a reset starts the time-outs of tracked bodies anew
            due = monotonic() + AGAIN
            take_away(found["terrain"])
        return False

    take_away(probe.newest_diagnostics().get("terrain", {}))  # likely all of it, a diagnostics period earlier
    due = monotonic() + AGAIN
    probe.wait_for(empty)


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


@pytest.fixture
def log(shared_node: tuple[Probe, Process]) -> Log:
    """What the shared node says from now on."""
    return Log(shared_node[1])
