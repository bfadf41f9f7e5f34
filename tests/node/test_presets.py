"""Deployment by parameters: presets, help, and files that say everything."""

import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, ListParameters

from smartmesh_ros.node.parameters.specifications import SPECS
from smartmesh_ros.tools.demo import terrain_source
from smartmesh_ros.tools.testing import COLLIDER, Probe, executable
from tests.node.shared import values

CONFIG = Path(__file__).parents[2] / "config"
PRESETS = sorted(path for path in CONFIG.glob("*.yaml") if path.name != "diagnostic_aggregator.yaml")


def parameters_of(path: Path) -> dict[str, Any]:
    return dict(yaml.safe_load(path.read_text())["/**"]["ros__parameters"])


def warnings(output: str) -> list[str]:
    return [line for line in output.splitlines() if "[WARN" in line or "[ERROR" in line or "Traceback" in line]


def test_the_presets_of_the_readme_are_there() -> None:
    assert {path.stem for path in PRESETS} >= {"rover", "quadruped", "fleet", "accurate", "fast"}


@pytest.mark.parametrize("preset", PRESETS, ids=lambda path: path.stem)
def test_a_preset_is_taken_whole_and_without_a_warning_and_the_node_hears_itself_nowhere(
    probe: Probe, preset: Path
) -> None:
    arguments = ["--ros-args", "--params-file", str(preset)]
    with probe.running(arguments=arguments) as process:
        wanted = parameters_of(preset)
        assert values(probe, wanted) == wanted
        probe.latest("timing")
        assert own_topics(probe) == set()
        assert warnings(process.output) == []


def own_topics(probe: Probe) -> set[str]:
    """Topics that the collider both publishes and subscribes to."""
    node, name = probe.node, COLLIDER.strip("/")
    topics = {f"{COLLIDER}/body_states", f"{COLLIDER}/heightmap"}
    # The node's endpoints may be known before its name is.
    probe.wait_for(lambda: name in node.get_node_names() and topics <= dict(node.get_topic_names_and_types()).keys())
    published = dict(node.get_publisher_names_and_types_by_node(name, "/"))
    taken = dict(node.get_subscriber_names_and_types_by_node(name, "/"))
    assert f"{COLLIDER}/body_states" in published
    assert f"{COLLIDER}/heightmap" in taken
    return published.keys() & taken.keys()


def check_descriptions(probe: Probe) -> None:
    """Every parameter is described, and every number is bounded."""
    names = [spec.name for spec in SPECS]
    described = probe.call("describe_parameters", DescribeParameters, names=names).descriptors
    numbers = (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)
    for spec, item in zip(SPECS, described, strict=True):
        assert item.description.endswith(".")
        assert item.read_only == spec.read_only
        if item.type in numbers:
            assert item.floating_point_range or item.integer_range, item.name
        if item.type == ParameterType.PARAMETER_DOUBLE_ARRAY:
            assert item.additional_constraints.startswith("each "), item.name


def test_all_is_described_and_a_dump_of_a_node_starts_the_same_node_again(probe: Probe, tmp_path: Path) -> None:
    """As `ros2 param dump` writes it: every parameter that is set."""
    changed = {
        "physics.rate": 60.0,
        "patch.kind": "heightfield",
        "raster.origin": [1.0, 2.0, 3.0],
        "terrain.changes": "correction",
        "terrain.noise": 0.01,
    }
    with probe.running(parameters=changed):
        assert values(probe, changed) == changed
        names = probe.call("list_parameters", ListParameters).result.names
        assert {spec.name for spec in SPECS} <= set(names)
        check_descriptions(probe)
        before = values(probe, names)
    dump = tmp_path / "dump.yaml"
    dump.write_text(yaml.safe_dump({"/terrain_collider": {"ros__parameters": before}}))
    with probe.running(arguments=["--ros-args", "--params-file", str(dump)]) as process:
        assert values(probe, names) == before
        assert warnings(process.output) == []


def test_a_printed_parameter_file_says_all_the_defaults(probe: Probe, tmp_path: Path) -> None:
    command = [executable("terrain_collider"), "--print-parameters"]
    file = tmp_path / "all.yaml"
    file.write_text(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    set_there = {spec.name: spec.default for spec in SPECS if spec.default != []}
    assert parameters_of(file) == set_there
    assert all(spec.name in file.read_text() for spec in SPECS)
    with probe.running(arguments=["--ros-args", "--params-file", str(file)]) as process:
        assert values(probe, list(set_there)) == set_there
        assert warnings(process.output) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("terrain_collider", [spec.name for spec in SPECS]),
        ("terrain_source", [spec.name for spec in terrain_source.SPECS]),
        ("smartmesh-demo", ["--seconds", "--out"]),
    ],
)
def test_each_executable_explains_itself(domain: int, name: str, words: list[str]) -> None:
    result = subprocess.run([executable(name), "--help"], capture_output=True, text=True, check=True)
    assert result.stdout.startswith("usage:") and result.stderr == ""
    assert all(word in result.stdout for word in words)
    result = subprocess.run([executable(name), "--hepl"], capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "--hepl" in result.stderr
