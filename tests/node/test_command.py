"""``smartmesh``, the command: what it shows of a node and has it do, over DDS."""

import argparse
import os
import re
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from ament_index_python.packages import get_package_prefix

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.transport import colliders
from smartmesh_ros.startup.executables import STARTED_BY_NAME
from smartmesh_ros.tools.client import command
from smartmesh_ros.tools.client.remote import CHECK_PERIOD, Remote
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, heightmap_message
from tests.memory import needs_shared_memory
from tests.node.shared import changed, position_of, show_level_ground, wait_until
from tests.urdfs import link, mesh, robot

# The fixtures' probe reads nothing while a command runs: few messages wait then, behind which answers would wait.
SHARED = {"publish.patches": 10.0, "publish.body_states": 10.0}
Command = Callable[..., str]
COMMAND = Path(get_package_prefix("smartmesh_ros")) / "bin" / "smartmesh"


@pytest.fixture(scope="module")
def remote(shared_node: tuple[Probe, Process, Any]) -> Iterator[Remote]:
    """The node as all commands of the module see it: each process of its own would have to discover it first."""
    rclpy.init()
    with closing(Remote(shared_node[0].collider, 20.0)) as made:
        yield made
    rclpy.try_shutdown()


@pytest.fixture
def smartmesh(remote: Remote, capfd: pytest.CaptureFixture[str]) -> Command:
    """What a command prints, or what it is refused with."""

    def run(*words: str) -> str:
        options = command.parser().parse_args(words)
        remote.spin(0.05)
        capfd.readouterr()
        try:
            return str(options.act(remote, options)) or capfd.readouterr().out.strip()
        except InputError as error:
            return f"refused: {error}"

    return run


def whole(*words: str) -> str:
    """What the command prints, or what it ends with."""
    result = subprocess.run([COMMAND, *words], capture_output=True, text=True, timeout=120, check=False)
    return result.stderr if result.returncode else result.stdout.strip()


def test_nodes_that_are_discovered_late_and_one_after_the_other_are_listed(
    remote: Remote, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One may be too busy to answer at once: this process announces itself for three seconds."""
    now = [0.0]
    monkeypatch.setattr(command, "monotonic", lambda: now[0])
    monkeypatch.setattr(remote, "spin", lambda _: now.__setitem__(0, now[0] + 0.1))
    monkeypatch.setattr(command, "colliders", lambda _: ["/a", "/b"][: (now[0] > 0.2) + (now[0] > 3.4)])
    assert command.show_nodes(remote, argparse.Namespace()).split() == ["/a", "/b"]


def test_bodies_are_spawned_listed_and_removed(shared: Probe, smartmesh: Command, tmp_path: Path) -> None:
    """The node is the only one, so that it need not be named."""
    show_level_ground(shared)
    for name, words in {
        "ball": "--sphere 0.3 --at 1 2 --mass 2", "crate": "--box 0.6 0.4 0.2 --at 3 3 --yaw 0.5",
        "can": "--cylinder 0.8 0.25 --at 5 1", "pill": "--capsule 0.5 0.1 --at 5 5 --z 0.35",
    }.items():  # fmt: skip
        assert smartmesh("spawn", name, *words.split()) == f"{name} is there"
    file = tmp_path / "rover.urdf"
    file.write_text(robot(link("base", '<box size="0.4 0.3 0.2"/>', 3.0)))
    assert smartmesh("spawn", "rover", "--urdf", str(file), "--at", "1", "4.5") == "rover is there"
    shared.wait_for(lambda: position_of(shared, "ball") == pytest.approx((1.0, 2.0, 0.3), abs=0.01))
    shown = smartmesh("list").splitlines()
    kinds = [line.partition(",")[0] for line in shown]
    assert kinds == [
        "ball: sphere 0.3", "crate: box 0.6 x 0.4 x 0.2", "can: cylinder 0.8 x 0.25", "pill: capsule 0.5 x 0.1",
        "rover: robot",
    ]  # fmt: skip
    assert shown[0].endswith("at (1.000, 2.000, 0.300)")
    states = yaml.safe_load(smartmesh("echo", "body_states", "--once").removesuffix("---"))
    assert [body["id"] for body in states["bodies"]] == ["ball", "crate", "can", "pill", "rover"]
    assert states["bodies"][0]["mass"] == 2.0
    assert smartmesh("remove", "crate", "can") == ""
    assert [line.partition(":")[0] for line in smartmesh("list").splitlines()] == ["ball", "pill", "rover"]


def test_a_tracked_body_is_listed_by_what_is_known_of_it(shared: Probe, smartmesh: Command) -> None:
    """The node publishes no poses of tracked bodies, which come from its sources."""
    show_level_ground(shared)
    with changed(shared, {"bodies.timeout": 1000.0}):
        shared.wait_for(lambda: shared.publish_bodies({"crane": (1.0, 1.0, 0.3)}, 0.3) or shared.patches())
        assert smartmesh("list") == "crane: sphere 0.3, tracked, where the topic with its poses says"


def test_what_is_refused_is_told(shared: Probe, smartmesh: Command, tmp_path: Path) -> None:
    def refusal(*words: str) -> str:
        said = smartmesh(*words)
        assert said.startswith("refused: ")
        return said

    assert "there is no body 'nobody'" in refusal("remove", "nobody")
    assert "there is no URDF file" in refusal("spawn", "none", "--urdf", str(tmp_path / "none.urdf"))
    assert "leave --z out" in refusal("spawn", "ball", "--sphere", "1", "--z", "2", "--align")
    (tmp_path / "hull.stl").write_bytes(b"")
    file = tmp_path / "robot.urdf"
    file.write_text(robot(link("base", mesh("hull.stl"))))
    said = refusal("spawn", "mine", "--urdf", str(file))
    assert "is not in bodies.urdf_folders: add its folder" in said and str(tmp_path / "hull.stl") in said
    assert "physics is running" in refusal("step")
    assert "no parameter 'physics.rat'; did you mean 'physics.rate'?" in refusal("param", "physics.rat")
    assert "it must be" in refusal("param", "physics.rate", "-3")
    for text in ("[", "{a: 1}", "2024-01-01", "2024-13-01", "[0, down]", "!!bool x"):
        assert "write a number, a text, true, false, or a list of one of these" in refusal("param", "frame_id", text)
    assert "it must be of type float, 1 to 10000" in refusal("param", "physics.rate", "1" + 30 * "0")
    assert "put no option before run" in refusal("--timeout", "5", "run", "terrain_source")


def test_a_robot_is_sent_as_the_node_reads_its_file(shared: Probe, smartmesh: Command, tmp_path: Path) -> None:
    """With space before its declaration, and without meshes that are only seen."""
    show_level_ground(shared)
    seen = f"<visual><geometry>{mesh('none.stl')}</geometry></visual>"
    file = tmp_path / "robot.urdf"
    file.write_text("\n<?xml version='1.0'?>" + robot(link("base", more=seen)))
    assert smartmesh("spawn", "rover", "--urdf", str(file), "--at", "3", "3") == "rover is there"
    file.write_text(robot("<xacro:wheel/>"))
    assert "expand it first: xacro" in smartmesh("spawn", "other", "--urdf", str(file))


def test_messages_that_cannot_be_imported_are_named(
    shared: Probe, smartmesh: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "sensor_msgs.msg", None)  # of which nothing is received meanwhile
    assert "sensor_msgs/msg/JointState is not installed" in smartmesh("echo", "joint_states", "--once")


def test_physics_and_parameters_are_set(shared: Probe, smartmesh: Command) -> None:
    assert smartmesh("nodes") == shared.collider
    assert smartmesh("pause") == "paused"
    shared.wait_for(lambda: "physics: ok, paused" in smartmesh("status"))
    assert smartmesh("step", "3") == "" and smartmesh("resume") == "running"
    assert smartmesh("param", "physics.friction", "0.75") == ""
    assert smartmesh("param", "physics.friction") == "0.75"
    assert "physics.friction: 0.75" in smartmesh("param").splitlines()
    assert smartmesh("param", "physics.friction", "0.5") == ""
    assert "back where they were spawned" in smartmesh("reset")


def test_a_command_receives_no_maps(shared: Probe, remote: Remote, smartmesh: Command) -> None:
    """Each one of 64 MiB would delay the machine."""
    show_level_ground(shared)
    assert smartmesh("pause") == "paused" and smartmesh("resume") == "running"
    remote.spin(1.1 * CHECK_PERIOD)
    assert not [one.topic_name for one in remote.node.subscriptions if "heightmap" in one.topic_name]


@needs_shared_memory  # without it Fast DDS itself says so beside the output
def test_a_node_is_named_or_those_that_run_are(shared: Probe, remote: Remote) -> None:
    """``remote`` has made the context that the other one needs."""
    assert whole("--node", shared.collider, "list") == "no bodies"
    with closing(Remote("/terrain_collider", 0.2)) as other:
        wait_until(lambda: other.spin(0.05) or colliders(other.node))
        options = command.parser().parse_args(["pause"])
        with pytest.raises(InputError) as missing:
            options.act(other, options)
    domain = os.environ["ROS_DOMAIN_ID"]
    words = f"no terrain_collider is named /terrain_collider in DDS domain {domain} (ROS_DOMAIN_ID)"
    assert str(missing.value).startswith("no service /terrain_collider/pause after 0.2 s; ")
    assert str(missing.value).endswith(f"; {words}; running: {shared.collider}")


def test_a_topic_that_is_misspelt_is_answered_by_the_one_that_may_be_meant(
    shared: Probe, remote: Remote, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote, "_patience", 1.0)
    for topic, hint in (("body_state", "; did you mean 'body_states'?"), ("imu", "")):
        options = command.parser().parse_args(["echo", topic, "--once"])
        with pytest.raises(InputError, match=rf"no topic {shared.collider}/{topic} after [\d.]+ s{re.escape(hint)}$"):
            options.act(remote, options)


def test_negative_numbers_are_no_options() -> None:
    parse = command.parser().parse_args
    assert parse(["spawn", "ball", "--sphere", "0.1", "--at", "-3.1e-16", "-2.", "--z", "-1E3"]).at == [-3.1e-16, -2.0]
    assert parse(["param", "physics.friction", "-1e-6"]).value == "-1e-6"


def test_of_a_large_message_only_what_is_printed_is_copied() -> None:
    message = heightmap_message(np.zeros((1000, 1000)))
    tracemalloc.start()
    shown = command.plain(message)["heights"]
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert shown == [0.0] * 12 + ["... 999988 more"] and most < 100_000


def test_options_that_mean_nothing_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert whole("--node", "a b", "nodes").startswith("smartmesh: '/a b' is no full name of a node")
    for name in ("", "robot-1/terrain_collider"):
        with pytest.raises(InputError, match="is no full name of a node, such as /robot/terrain_collider"):
            Remote(f"/{name}")
    for line, words in (
        ("step -1", ["'-1' is no whole number from 1 to 100000"]),
        ("--timeout nan nodes", ["'nan' is no number from 0 to inf"]),
        ("spawn ball --sphere 1 --yaw inf", ["'inf' is no number from -1000 to 1000"]),
        ("run terrain_colider", ["invalid choice: 'terrain_colider'", *STARTED_BY_NAME]),
    ):
        with pytest.raises(SystemExit):
            command.parser().parse_args(line.split())
        said = capsys.readouterr().err
        assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("variables", "closed"),
    [({"HOME": "/proc", "PYTHONIOENCODING": "ascii"}, ""), ({}, ">&-"), ({}, "<&- >&- 2>&-")],
)
def test_a_command_ends_well_without_logs_or_letters_or_open_streams(
    shared: Probe, variables: dict[str, str], closed: str
) -> None:
    show_level_ground(shared)
    spawn = f"spawn R\u00e4dchen_{len(closed)} --sphere 0.1 --at 2 2"
    command = f'"{COMMAND}" --node {shared.collider} {spawn} {closed}'
    environment = {name: value for name, value in os.environ.items() if name not in ("ROS_HOME", "ROS_LOG_DIR")}
    done = subprocess.run(
        ["sh", "-c", command], env=environment | variables, capture_output=True, timeout=TIMEOUT, check=False
    )
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False), done.stderr
    assert done.stdout.endswith(b"is there\n") != bool(closed)


def test_a_command_that_is_interrupted_has_not_done_its_work(shared: Probe) -> None:
    """Which what follows it in a script sees, wherever it was: during the imports in test_processes.py."""

    def commands() -> int:
        return shared.node.get_node_names().count("smartmesh_view")

    before = commands()  # that of the module's fixture
    with subprocess.Popen([COMMAND, "--node", "/nowhere", "--timeout", "1000", "list"]) as waiting:
        try:
            shared.wait_for(lambda: commands() > before)
            waiting.send_signal(signal.SIGINT)
            assert waiting.wait(TIMEOUT) == 130
        finally:
            waiting.kill()


def test_the_command_of_a_workspace_starts_its_executables() -> None:
    """It stands where `setup.bash` has the path lead, beside the folder of those that `ros2 run` finds."""
    assert str(Path(get_package_prefix("smartmesh_ros")) / "bin") in os.environ["PATH"].split(os.pathsep)
    assert "wave.amplitude" in whole("run", "terrain_source", "--print-parameters")
