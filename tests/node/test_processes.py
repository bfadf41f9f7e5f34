"""Starting, stopping and restarting processes."""

import contextlib
import gc
import resource
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import psutil
import pytest
from rclpy.node import Node
from smartmesh_msgs.srv import QueryGround, StepPhysics
from std_srvs.srv import SetBool

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.refusals import Refusals
from smartmesh_ros.node.running import run
from smartmesh_ros.node.timing.pacing import Pacer
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, assert_cannot_start, executable
from tests.node.shared import show_map, wait_until
from tests.preloaded import has_ended

pytestmark = pytest.mark.usefixtures("executables")


@pytest.fixture
def own_signals() -> Iterator[None]:
    """A node of this process takes the signals; after the test they are as before."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def test_a_signal_ends_the_node_cleanly(probe: Probe) -> None:
    """SIGTERM: `test_signals_are_obeyed_within_a_second_under_load`."""
    with probe.running() as process:
        show_map(probe, np.zeros((50, 50)))
        # A long answer, which is given in turns, comes after short ones; each gets its own.
        asked = probe.client("query_ground", QueryGround)
        calls = [asked.call_async(QueryGround.Request(x=[0.1] * n, y=[0.1] * n)) for n in (90_000, 1, 50_000, 2)]
        probe.wait_for(lambda: all(call.done() for call in calls))
        assert [len(call.result().z) for call in calls] == [90_000, 1, 50_000, 2]
        # Whoever waits when the node ends is told.
        assert probe.call("pause", SetBool, data=True).success
        steps = probe.client("step", StepPhysics)
        calls = [steps.call_async(StepPhysics.Request(steps=100_000)) for _ in range(20)]
        # A call that is refused at its turn, and whose answer shows that the node has those before it.
        assert not probe.call("step", StepPhysics, steps=0).success
        assert process.stop(signal.SIGINT) == 0
        probe.wait_for(lambda: all(call.done() for call in calls))
        assert "the node ends before this is done" in calls[-1].result().message
        assert "Traceback" not in process.output


@pytest.mark.parametrize(
    ("name", "arguments", "words", "code"),
    [
        ("smartmesh-fleet", ["--nodes", "1", "--bodies", "1"], "real-time", 0),
        ("smartmesh-demo", ["--seconds", "1000"], "starting", 1),
        ("view", ["--demo", "--port", "0"], "starting", 0),
    ],
)
def test_a_signal_ends_a_program_and_the_nodes_that_it_started(
    name: str, arguments: list[str], words: str, code: int
) -> None:
    """With an end that is not the one asked for, the demo says so. For the map of those that a terminal ends, too, a
    view would wait in vain."""
    with Process(name, arguments=arguments) as process:
        wait_until(lambda: words in process.output)
        children = psutil.Process(process.process.pid).children(recursive=True)
        assert children
        for child in children if name == "view" else []:
            child.terminate()  # as SIGINT, but before Python runs it says nothing
        assert process.stop() == code, process.output
        assert "Traceback" not in process.output
        wait_until(lambda: all(has_ended(child.pid) for child in children))


@pytest.mark.parametrize(
    ("arguments", "environment", "words"),
    [
        (["-r", f"__node:={'n' * 256}"], {}, "node name length should not exceed '255'"),
        (["-p", "frame_id:=\udcff"], {}, r"an argument is no UTF-8: 'frame_id:=\udcff'"),
        ([], {"ROS_STATIC_PEERS": "no_such_machine.invalid"}, "Unable to resolve peer no_such_machine.invalid"),
    ],
)
def test_what_ros_refuses_ends_the_start_with_its_reason(
    arguments: list[str], environment: dict[str, str], words: str
) -> None:
    with Process("terrain_collider", arguments=["--ros-args", *arguments], environment=environment) as process:
        assert process.process.wait(TIMEOUT) == 2, process.output
        reason = process.output.splitlines()[-1]
        assert reason.startswith("cannot start: ") and reason.endswith(words)
        assert "Traceback" not in process.output


@pytest.mark.parametrize("made_of_it", [KeyboardInterrupt, ImportError, RuntimeError, InputError])
def test_a_signal_during_the_start_ends_a_node_whatever_error_compiled_code_makes_of_it(
    own_signals: None, made_of_it: type[BaseException]
) -> None:
    """As Matplotlib's imports do."""

    def make() -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise made_of_it(*["initialization failed"] * 2)

    with pytest.raises(SystemExit) as end:
        run(make, [])
    assert not end.value.code


@pytest.mark.parametrize(
    ("name", "number", "code"),
    [
        ("smartmesh-demo", signal.SIGTERM, 0), ("terrain_collider", signal.SIGINT, 0), ("replay", signal.SIGINT, 130),
        ("smartmesh", signal.SIGINT, 130),
    ],
)  # fmt: skip
def test_a_signal_during_the_imports_ends_an_executable(name: str, number: signal.Signals, code: int) -> None:
    """They last a second; nothing is to be cleaned up. Started as a shell starts a background job, SIGINT ignored. What
    follows a command in a script sees that it has not done its work."""
    command = ["sh", "-c", "trap '' INT; exec \"$0\"", str(executable(name))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            loaded = Path(f"/proc/{process.pid}/maps")
            wait_until(lambda: process.poll() is not None or "numpy" in loaded.read_text())
            process.send_signal(number)
            assert (process.communicate(timeout=TIMEOUT)[0], process.returncode) == ("", code)
        finally:
            process.kill()


def test_a_second_signal_while_the_node_ends_changes_nothing(probe: Probe) -> None:
    """Ctrl-C by who is impatient, and by launch beside a terminal."""
    with Process("terrain_collider") as process:
        probe.wait_for(lambda: "terrain_collider" in probe.node.get_node_names(), watch=process)
        while process.process.poll() is None:
            process.process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.process.wait(0.005)
        assert process.process.returncode == 0, process.output


@pytest.mark.parametrize(("name", "home"), [("terrain_collider", None), ("terrain_sensor", "/proc")])
def test_a_node_runs_without_a_folder_for_logs(
    probe: Probe, name: str, home: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("HOME", "ROS_HOME", "ROS_LOG_DIR"):
        monkeypatch.delenv(variable, raising=False)
    if home:
        monkeypatch.setenv("HOME", home)
    with Process(name) as process:
        probe.wait_for(lambda: name in probe.node.get_node_names(), watch=process)
        assert process.output.startswith("no log files: "), process.output
        assert process.stop() == 0


def test_a_node_runs_with_its_standard_streams_closed(probe: Probe) -> None:
    command = 'exec "$0" >&- 2>&- <&-'
    with subprocess.Popen(["sh", "-c", command, str(executable("terrain_collider"))]) as process:
        try:
            probe.wait_for(lambda: process.poll() is not None or probe.connected())
        finally:
            process.send_signal(signal.SIGINT)
    assert process.returncode == 0


def test_a_node_counts_no_deadlines_while_it_starts(own_signals: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock goes on by 1000 s while it is made, as if it read a large file."""
    missed, started = list[int](), [0.0]

    class Slow(Node):
        handled, idle, turn = 0, lambda _: None, lambda _: False

        def __init__(self) -> None:
            super().__init__("slow")
            self.refusals = Refusals(self.get_logger())
            self.pacer = Pacer(0.2, now=lambda: monotonic() + started[0])
            started[0] = 1000.0

        def tick(self, advance: Callable[[], int]) -> None:
            advance()
            missed.append(self.pacer.misses)
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(gc, "freeze", int)  # the node would be kept
    run(Slow, [])
    assert missed[0] < 100


SECURE = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce", "ROS_SECURITY_KEYSTORE": "/nowhere"}


@pytest.mark.parametrize(
    ("name", "parameters", "environment", "words"),
    [
        ("terrain_score", {"csv": "/nowhere/score.csv"}, {}, "csv cannot be written: [Errno 2]"),
        ("terrain_collider", {}, {"ROS_DOMAIN_ID": "300"}, "ROS_DOMAIN_ID is '300'; it must be"),
        # No node runs in the clear where security was asked for.
        ("terrain_collider", {}, SECURE, "no security, which ROS_SECURITY_ENABLE asks for: "),
    ],
)
def test_what_cannot_be_stops_the_start(
    name: str, parameters: dict[str, Any], environment: dict[str, str], words: str
) -> None:
    assert_cannot_start(parameters, f"cannot start: {words}", name=name, environment=environment)


def test_signals_are_obeyed_within_a_second_under_load(probe: Probe) -> None:
    """Within a second of the node's own processor time, which takes longer on a busy machine."""
    with probe.running() as process:
        probe.publish_map(np.zeros((512, 512)))
        crowd = [(5.0 + 0.1 * (i % 20), 5.0 + 0.1 * (i // 20), 0.0) for i in range(200)]

        def all_patched() -> bool:
            probe.publish_poses(crowd)
            return len(probe.patches()) == 200

        probe.wait_for(all_patched)
        ended, times = processor_time_of_ended(), psutil.Process(process.process.pid).cpu_times()
        assert process.stop(signal.SIGTERM) == 0
        assert processor_time_of_ended() - ended - times.user - times.system < 1.0


def processor_time_of_ended() -> float:
    """Processor time of all processes that this one started and that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
