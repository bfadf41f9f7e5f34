"""What the node says at the start and at changes, and what it measures of itself from the first second on."""

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pybullet_data
import pytest
import yaml
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import SetBool, Trigger

from smartmesh_ros.node.outputs import publishing
from smartmesh_ros.node.parameters.parameter_files import files_of, mismatch
from smartmesh_ros.testing import Probe, Process, executable

pytestmark = pytest.mark.usefixtures("executables")

HUSKY = Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"


def lines(process: Process, level: str) -> list[str]:
    return [line for line in process.output.splitlines() if f"[{level}]" in line]


def set_string(probe: Probe, name: str, value: str) -> Any:
    given = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
    return probe.call("set_parameters", SetParameters, parameters=[Parameter(name=name, value=given)]).results[0]


def test_one_line_tells_the_start_and_pybullet_says_nothing(probe: Probe) -> None:
    """A robot whose links lack inertias has PyBullet warn; its build time and its command line it tells unasked."""
    robot = f"{{id: husky, urdf: {HUSKY}, xyz: [0, 0, 1]}}"
    with probe.running(parameters={"physics.rate": 120.0, "bodies.spawn": [robot]}) as process:
        probe.wait_for(lambda: probe.latest("body_states").bodies)
        process.stop()
        note, line = process.output.splitlines()
    assert "'base_footprint' has no mass" in note, "of the robot, once"
    for words in ("[INFO]", "~/heightmap", "120 Hz", "auto within 0.0005 m", "events", "parameters.yaml"):
        assert words in line


def test_help_is_still_printed(domain: int) -> None:
    result = subprocess.run([executable("terrain_collider"), "--help"], capture_output=True, text=True, check=True)
    assert result.stdout.startswith("usage:")
    assert result.stderr == ""


@pytest.mark.parametrize(
    ("names", "fits"),
    [
        (["/**"], True),
        (["terrain_collider"], False),
        (["robot", "terrain_collider"], True),
        (["/robot/terrain_collider"], True),
        (["/*/terrain_collider"], True),
        (["/robot/**"], True),
        (["/terrain_collider"], False),
        (["/robot/terrain_colider"], False),
    ],
)
def test_a_parameter_file_is_for_the_nodes_it_names(tmp_path: Path, names: list[str], fits: bool) -> None:
    content: Any = {"ros__parameters": {"physics.rate": 100.0}}
    for name in reversed(names):
        content = {name: content}
    file = tmp_path / "some.yaml"
    file.write_text(yaml.safe_dump(content))
    assert (mismatch(file, "/robot/terrain_collider") is None) == fits
    assert files_of(["node", "--ros-args", "--params-file", str(file), "-p", "a:=1"]) == [file]


def test_a_parameter_file_for_another_node_is_named(probe: Probe, tmp_path: Path) -> None:
    file = tmp_path / "other.yaml"
    file.write_text("/other_node:\n  ros__parameters:\n    physics.rate: 100.0\n")
    with probe.running(arguments=["--ros-args", "--params-file", str(file)]) as process:
        [line] = lines(process, "WARN")
        assert f"{file} has no effect: it is for /other_node" in line
        assert "240 Hz; " in process.output, "as rcl has it: the default"


def test_a_node_of_the_same_name_is_warned_about(shared: Probe, shared_node: tuple[Probe, Process]) -> None:
    first = shared_node[1]
    assert lines(first, "WARN") == []
    with Process("terrain_collider", arguments=["--ros-args", "-r", f"__ns:={shared.namespace}", "--"]) as second:
        for process in (first, second):
            shared.wait_for(lambda process=process: any("another node" in line for line in lines(process, "WARN")))
    assert len(lines(first, "WARN")) == 1


def test_each_changed_parameter_has_a_line(shared: Probe, shared_node: tuple[Probe, Process]) -> None:
    before = len(lines(shared_node[1], "INFO"))
    assert set_string(shared, "patch.kind", "heightfield").successful
    assert set_string(shared, "patch.kind", "heightfield").successful
    assert set_string(shared, "terrain.motion", "hold").successful
    changed = shared.wait_for(lambda: len(found := lines(shared_node[1], "INFO")[before:]) >= 2 and found)
    assert [line.partition("parameter ")[2] for line in changed] == [
        "patch.kind is now 'heightfield'; it was 'auto'",
        "terrain.motion is now 'hold'; it was 'extrapolate'",
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("patch.kin", "unknown; did you mean 'patch.kind'?"),
        ("zzz", "parameter 'zzz' is unknown"),
        ("executor", "executor is fixed after the start; restart the node"),
    ],
)
def test_a_refused_change_says_what_would_be_right(shared: Probe, name: str, words: str) -> None:
    result = set_string(shared, name, "single_threaded")
    assert not result.successful
    assert words in result.reason


def test_the_real_time_factor_is_of_the_time_that_the_loop_ran(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(publishing, "monotonic", lambda: now)
    session: Any = SimpleNamespace(world=SimpleNamespace(time=0.0), pacer=SimpleNamespace(misses=0))
    window = publishing._Window(session)
    now += 0.1
    assert window.read()[:2] == pytest.approx((0.1, 1.0)), "too short to tell"
    now, session.world.time = now + 0.9, 0.5
    assert window.read()[:2] == pytest.approx((0.9, 0.5))
    now, session.world.time = now + 1.0, 0.0  # a reset
    window.restart()
    now, session.world.time = now + 1.0, 1.0
    assert window.read()[1] == pytest.approx(1.0)


def test_after_a_reset_and_a_pause_time_does_not_seem_to_stand_still(shared: Probe) -> None:
    shared.publish_map(np.zeros((50, 50)))
    for _ in range(2):
        shared.latest("/diagnostics")
    assert shared.call("pause", SetBool, data=True).success
    shared.wait_for(lambda: shared.diagnostics("physics")["message"] == "paused")
    assert shared.call("pause", SetBool, data=False).success
    assert float(shared.diagnostics("physics")["real-time factor"]) > 0.0
    assert shared.call("reset", Trigger).success
    for _ in range(2):
        assert float(shared.diagnostics("physics")["real-time factor"]) > 0.0
