"""Fixtures of the tests of nodes."""

from collections.abc import Iterator
from typing import Any

import pytest
from smartmesh_msgs.srv import RestoreState, SaveState
from std_srvs.srv import SetBool

from smartmesh_ros.node.timing.pacing import NodeClock
from smartmesh_ros.tools.testing import Probe, Process
from smartmesh_ros.tools.testing.probe import DIAGNOSTICS
from smartmesh_ros.tools.testing.process import start_command
from tests.node.shared import Log, Logged


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
def executables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes are started by their executables, for tests of the start and the end; see `tests.preloaded`."""
    monkeypatch.setattr(Process, "starter", staticmethod(start_command))


def clear(probe: Probe, start: Any) -> None:
    """Has the node go on from its first state, without bodies and terrain, again until no message is under way any
    more. Parameters and counts of what was refused stay as they are."""

    def start_over() -> bool:
        answer = probe.call("restore_state", RestoreState, state=start)
        assert answer.success, answer.message
        found = probe.diagnostics_by_task()
        counts = [found["terrain"]["tiles"], *(found["bodies"][name] for name in ("simulated", "tracked", "patches"))]
        return counts == ["0"] * 4

    assert probe.call("pause", SetBool, data=False).success
    probe.wait_for(start_over)


@pytest.fixture(scope="module")
def shared_node(domain: int, request: pytest.FixtureRequest) -> Iterator[tuple[Probe, Process, Any]]:
    """A node with the parameters ``SHARED`` of the module, if it has any, a probe of it, and its first state, in a
    namespace of their own: nodes that single tests start beside it do not disturb it, nor it them."""
    with Probe("shared") as made, made.running(parameters=getattr(request.module, "SHARED", None)) as process:
        yield made, process, made.call("save_state", SaveState).state


@pytest.fixture
def shared(shared_node: tuple[Probe, Process, Any]) -> Iterator[Probe]:
    """The probe of the module's shared node, for tests that need neither parameters nor an end of their own: without
    bodies and terrain, and running."""
    made, process, start = shared_node
    assert process.process.poll() is None, f"it ended in an earlier test: {process.output}"
    yield made
    if process.process.poll() is None:
        clear(made, start)
    for topic in set(made.received) - {DIAGNOSTICS}:  # those say whom the node is connected to
        made.received[topic].clear()


@pytest.fixture
def log(shared_node: tuple[Probe, Process, Any]) -> Log:
    """Lines with some words that the shared node says from now on."""
    _, process, _ = shared_node
    before = len(process.output)
    return lambda words: [line for line in process.output[before:].splitlines() if words in line]
