"""What the node says at the start and at changes, and what it measures of itself from the first second on."""

import math
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.fleet import front
from smartmesh_ros.node.outputs import diagnostics
from smartmesh_ros.node.parameters.declaring import checked
from smartmesh_ros.node.parameters.helping import answer
from smartmesh_ros.node.parameters.specifications import SPECS, settings_from
from smartmesh_ros.node.sensor import terrain_sensor
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.node.timing.pacing import Pacer
from smartmesh_ros.tools.demo import rover, terrain_source
from smartmesh_ros.tools.score import terrain_score
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, executable
from tests.node.shared import Log, Logged, fed, made_with, refusal_at_start
from tests.urdfs import HUSKY

pytestmark = pytest.mark.usefixtures("executables")

OTHER_NODES: dict[str, tuple[Any, Any]] = {
    "terrain_source": (terrain_source.TerrainSource, terrain_source.SPECS),
    "terrain_score": (terrain_score.TerrainScore, terrain_score.SPECS),
    "terrain_sensor": (terrain_sensor.TerrainSensor, terrain_sensor.SPECS),
    "fleet_front": (front.Front, front.SPECS),
    "rover": (rover.Rover, rover.SPECS),
}
MALFORMED = [
    True, 0, -1, 2**62, 1e300, math.nan, "", "x", "/a b", [], [""], ["/a b"], ["//"], ["a", "a"], ["{"], [True], [1, 2],
    [1.0, 0.0], [math.nan] * 3,
]  # fmt: skip


def test_one_line_tells_the_start_and_pybullet_says_nothing() -> None:
    """A robot whose links lack inertias has PyBullet warn; its build time and its command line it tells unasked. In a
    namespace of its own: a node of the same name that another test left behind would be warned of."""
    parameters = {"physics.rate": 120.0, "bodies.spawn": [f"{{id: husky, urdf: {HUSKY}, xyz: [0, 0, 1]}}"]}
    with Probe(namespace="start") as probe, probe.running(parameters=parameters) as process:
        probe.wait_for(lambda: probe.latest("body_states").bodies)
        process.stop()
        root, masses, ignored, line = process.output.splitlines()
    wheels = ", ".join(f"{end}_{side}_wheel_link" for end in ("front", "rear") for side in ("left", "right"))
    assert ignored.endswith(f"without effect: <gazebo> mu1, <gazebo> mu2, <gazebo> kp, <gazebo> kd of {wheels}")
    assert "'base_footprint' has no mass" in root and "links without <inertial> have no mass" in masses, "once each"
    assert "[WARN]" in ignored and all("[INFO]" in usual for usual in (root, masses, line))
    assert all(words in line for words in ("~/heightmap", "120 Hz", "parameters.yaml"))


def test_executables_end_quietly_if_nobody_reads_their_output() -> None:
    """As `--help | head` does."""
    running = []
    for name, *arguments in (
        ("terrain_collider", "--help"), ("terrain_source", "--print-parameters"), ("smartmesh-demo", "--seconds", "99"),
    ):  # fmt: skip
        command = [executable(name), *arguments]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        running[-1].stdout.close()
    for process in running:
        assert (process.communicate(timeout=TIMEOUT)[1], process.returncode) == ("", 0), process.args


@pytest.mark.parametrize("name", ["terrain_collider", "replay"])
def test_an_output_that_a_full_disk_does_not_take_is_told(name: str) -> None:
    with Path("/dev/full").open("w") as full:
        command = [executable(name), "--help"]
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert ended.stderr == f"{name}: the output cannot be written: No space left on device\n"
    assert ended.returncode == 1


def test_sources_of_parameters_are_named_and_those_without_effect_are_warned_about(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, logged: Logged
) -> None:
    """Unknown ones, and those of a file for other nodes alone: files are for those that ROS takes them for. launch_ros
    makes the files launch_params_*."""
    arguments = ["--ros-args", "-r", "__ns:=/robot"]
    for name, text in (
        ("decks.yaml", "/**: {ros__parameters: {decks: [{deck: ferry, frame: ship}]}}"),
        ("launch_params_0mb3x", "/**: {ros__parameters: {physics.rate: 100.0}}"),
        ("launch_params_7qk1y", "robot: {terrain_collider: {ros__parameters: {physics.sleep: false}}}"),
        ("hold.yaml", "/*/terrain_collider: {ros__parameters: {terrain.motion: !!timestamp hold}}"),  # rcl skips tags
        ("stray.yaml", "/terrain_collider: {ros__parameters: {physics.rate: 50.0}}"),
    ):
        file = tmp_path / name
        file.write_text(text)
        arguments += ["--params-file", str(file)]
    arguments += ["-p", "terrain.noise:=0.01"]
    monkeypatch.setattr(sys, "argv", ["terrain_collider", *arguments])
    with made_with(TerrainCollider, {"terrain.motoin": "hold"}, arguments[1:]) as node:
        physics, motion = node.settings.world.physics, node.settings.motion
        assert (physics.rate, physics.sleep, motion.mode) == (100.0, False, "hold")
    lines = logged().splitlines()
    deck, unknown, stray = (line for line in lines if "[WARN]" in line)
    [start] = (line for line in lines if "[INFO]" in line)
    files = f"{tmp_path}/decks.yaml, values in a launch file, {tmp_path}/hold.yaml"
    assert start.endswith(f"parameters: {files}, -p terrain.noise")
    entries = "is unknown and has no effect; each entry of 'decks' is a text in quotes: \"{...}\""
    assert f"parameter 'decks.deck' {entries}" in deck
    assert "parameter 'terrain.motoin' is unknown and has no effect; did you mean 'terrain.motion'?" in unknown
    assert f"{file} has no effect: it is for /terrain_collider, and this node is /robot/terrain_collider" in stray


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--ros-args -p physics.gravity:=[0.0, down, -9.81]", "of the same type"),
        ("--ros-args -p physics.gravity:=[0, 0, -9.81]", "[0.0, 0.0, -9.81]"),
        ("--ros-args -p physics.rate:=[240.0", "name:=value"),
        ("--ros-args -p physics.rate", "name:=value"),
        ("--ros-args --params-file /no/such/file.yaml", "/no/such/file.yaml"),
        ("--ros-args --params-file", "path of a YAML file"),
        ("--ros-args --log-level loud", "loud"),
        ("--ros-args -r a:=:=b", "a:=:=b"),
        (f"--ros-args -r {Path.home()}/heightmap:=/maps", "put the remapping into quotes: '~/heightmap:=/maps'"),
        ("--ros-args --nonsense", "'--nonsense'"),
        ("-p physics.rate:=100.0", "'-p'; put --ros-args before it"),
        ("-x", "try --help"),
    ],
)
def test_what_is_no_command_line_is_refused_with_the_reason(
    capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    with pytest.raises(SystemExit) as end:
        answer("terrain_collider", None, SPECS, line.split(" ", 2))
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert not re.search(r"/\S+\.c:|error not set", said), "places in rcl's sources"


def test_a_parameter_file_that_rcl_does_not_read_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    for value, words in (("[0.0, -9.81", ""), ("[0, 0, -9.81]", "of the same type, so write [0.0, 0.0, -9.81]")):
        file.write_text(f"/**:\n  ros__parameters:\n    physics.gravity: {value}\n")
        refusal = refusal_at_start({}, ["--params-file", str(file)])
        assert str(file) in refusal and words in refusal


@pytest.mark.parametrize("specs", [SPECS, *(specs for _, specs in OTHER_NODES.values())])
def test_a_list_of_one_empty_text_is_the_empty_list(specs: Any) -> None:
    """ROS cannot write an empty list in every place, so this is usual."""
    lists = [spec.name for spec in specs if isinstance(spec.default, list) and float not in map(type, spec.default)]
    for empty in ([""], [], None):
        values = checked({**{spec.name: spec.default for spec in specs}, **dict.fromkeys(lists, empty)}, specs)
        assert all(values[name] == [] for name in lists)


@pytest.mark.parametrize("name", OTHER_NODES)
def test_a_node_takes_or_refuses_any_value_of_any_parameter(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some values are valid for some parameters; any other error than `InputError` would be a traceback."""
    monkeypatch.chdir(tmp_path)  # some are names of files
    make, specs = OTHER_NODES[name]
    defaults = {spec.name: spec.default for spec in specs}
    for spec in specs:
        possible = []
        for value in MALFORMED:
            with suppress(InputError):
                checked({**defaults, spec.name: value}, specs)
                possible.append(value)
        for value in possible[-2:]:  # not all, because it takes long
            with suppress(InputError), made_with(make, {spec.name: value}):
                pass


def test_the_collider_takes_or_refuses_any_value_of_any_parameter() -> None:
    defaults = {spec.name: spec.default for spec in SPECS}
    for spec in SPECS:
        for value in MALFORMED:
            with suppress(InputError):
                settings_from({**defaults, spec.name: value})


def test_a_node_of_the_same_name_is_warned_about(shared: Probe, log: Log) -> None:
    assert log("[WARN]") == []
    with Process("terrain_collider", arguments=["--ros-args", "-r", f"__ns:={shared.namespace}", "--"]) as second:
        shared.wait_for(lambda: log("another node") and "another node" in second.output)
    assert len(log("[WARN]")) == 1


def test_a_change_has_a_line_and_a_refusal_says_what_would_be_right(logged: Logged) -> None:
    with fed({}) as node:
        logged()
        for name, value in (("physics.sleep", False), ("physics.sleep", False), ("terrain.motion", "hold")):
            assert not node.set(name, value)
        assert [line.partition("parameter ")[2] for line in logged().splitlines()] == [
            "physics.sleep is now False; it was True",
            "terrain.motion is now 'hold'; it was 'extrapolate'",
        ]
        for name, words in (
            ("terrain.motoin", "unknown; did you mean 'terrain.motion'?"),
            ("zzz", "parameter 'zzz' is unknown"),
            ("frame_id", "frame_id is fixed after the start; restart the node"),
        ):
            assert words in node.set(name, "other")
        several = [Parameter("physics.rate", value=60.0), Parameter("terrain.motion", value="jelly")]
        assert "terrain.motion" in node.node.set_parameters_atomically(several).reason
        assert node.world.dt == pytest.approx(1.0 / 240.0), "all or none"
        assert not node.set("physics.rate", 60.0) and node.set("physics.rate", 0.0)
        assert node.world.dt == pytest.approx(1.0 / 60.0)


def test_the_real_time_factor_is_of_the_time_that_the_loop_ran() -> None:
    now = 100.0
    session: Any = SimpleNamespace(
        world=SimpleNamespace(time=0.0), pacer=Pacer(1 / 240), clock=SimpleNamespace(steady=lambda: now)
    )
    window = diagnostics.PaceWindow(session)
    now += 0.1
    assert window.read()[:2] == pytest.approx((0.1, 1.0)), "too short to tell"
    now, session.world.time = now + 0.9, 0.5
    assert window.read()[:2] == pytest.approx((0.9, 0.5))
    now, session.world.time = now + 1.0, 0.0  # a reset
    session.pacer.restart()
    assert window.read()[1] == pytest.approx(1.0)
    now, session.world.time = now + 1.0, 0.75
    assert window.read()[1] == pytest.approx(0.75)
    now += 1.0
    session.pacer.pause(True)
    session.pacer.pause(False)
    assert window.read()[1] == pytest.approx(1.0), "the time of a pause is none of a loop that cannot keep up"
