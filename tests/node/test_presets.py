"""Deployment by parameters: presets, help, files that say everything; and the node takes nothing from its own outputs:
else a robot's odometry becomes a tracked body inside that robot."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file

from smartmesh_ros.node.parameters.declaring import plain_value
from smartmesh_ros.node.parameters.helping import parameter_file
from smartmesh_ros.node.parameters.specifications import SPECS
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.tools.testing import COLLIDER, executable
from tests.launch_files import LAUNCH, Launch, Recorded, stand_ins
from tests.node.shared import Logged, made_with

__all__ = ["stand_ins"]

CONFIG = Path(__file__).parents[2] / "config"
PRESETS = sorted(path for path in CONFIG.glob("*.yaml") if path.name != "diagnostic_aggregator.yaml")


def parameters_of(path: Path) -> dict[str, Any]:
    return dict(yaml.safe_load(path.read_text())["/**"]["ros__parameters"])


def warnings(output: str) -> list[str]:
    return [line for line in output.splitlines() if "[WARN" in line or "[ERROR" in line or "Traceback" in line]


@pytest.mark.parametrize("preset", PRESETS, ids=lambda path: path.stem)
def test_a_preset_is_taken_whole_and_without_a_warning_and_the_node_hears_itself_nowhere(
    preset: Path, logged: Logged, stand_ins: dict[str, type[Recorded]]
) -> None:
    """That of elevation mapping with the names of topics of its launch file."""
    [launched] = Launch(LAUNCH / "elevation_mapping.launch.py", stand_ins).of("Node")
    renamed = launched.kwargs["remappings"] if preset.name == "elevation_mapping.yaml" else []
    rules = [part for old, new in renamed for part in ("-r", f"{old}:={new}")]
    with made_with(TerrainCollider, {}, ["--params-file", str(preset), *rules]) as node:
        wanted = parameters_of(preset)
        assert values(node, wanted) == wanted
        node.tick()
        assert own_topics(node) == set()
    assert warnings(logged()) == []


def own_topics(node: TerrainCollider) -> set[str]:
    """Topics that the collider both publishes and subscribes to."""
    published, taken = ({found.topic_name for found in ends} for ends in (node.publishers, node.subscriptions))
    assert f"{COLLIDER}/body_states" in published
    assert f"{COLLIDER}/heightmap" in taken
    return published & taken


def check_descriptions(node: TerrainCollider) -> None:
    """Every parameter is described, and every number is bounded."""
    described = node.describe_parameters([spec.name for spec in SPECS])
    numbers = (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)
    for spec, item in zip(SPECS, described, strict=True):
        assert item.description.endswith(".")
        assert item.read_only == spec.read_only
        if item.type in numbers:
            assert item.floating_point_range or item.integer_range, item.name
        if item.type == ParameterType.PARAMETER_DOUBLE_ARRAY:
            assert item.additional_constraints.startswith("each "), item.name


def values(node: TerrainCollider, names: Iterable[str]) -> dict[str, Any]:
    """Values of parameters; an empty list arrives as nothing."""
    found = {name: plain_value(node.get_parameter(name)) for name in names}
    return {name: [] if value is None else value for name, value in found.items()}


def test_all_is_described_and_a_dump_of_a_node_starts_the_same_node_again(tmp_path: Path, logged: Logged) -> None:
    """As `ros2 param dump` writes it: every parameter that is set."""
    changed = {
        "physics.rate": 60.0,
        "terrain.motion": "hold",
        "raster.origin": [1.0, 2.0, 3.0],
        "terrain.changes": "correction",
        "terrain.noise": 0.01,
    }
    with made_with(TerrainCollider, changed) as node:
        assert values(node, changed) == changed
        names = node.list_parameters([], 0).names
        assert {spec.name for spec in SPECS} <= set(names)
        check_descriptions(node)
        before = values(node, names)
    dump = tmp_path / "dump.yaml"
    dump.write_text(yaml.safe_dump({"/terrain_collider": {"ros__parameters": before}}))
    with made_with(TerrainCollider, {}, ["--params-file", str(dump)]) as node:
        assert values(node, names) == before
    assert warnings(logged()) == []


def test_a_printed_parameter_file_says_all_the_defaults(tmp_path: Path, logged: Logged) -> None:
    file = tmp_path / "all.yaml"
    file.write_text(parameter_file("terrain_collider", SPECS))
    set_there = {spec.name: spec.default for spec in SPECS if spec.default != []}
    assert parameters_of(file) == set_there
    assert all(spec.name in file.read_text() for spec in SPECS)
    with made_with(TerrainCollider, {}, ["--params-file", str(file)]) as node:
        assert values(node, set_there) == set_there
    assert warnings(logged()) == []


def test_the_executable_explains_itself() -> None:
    result = subprocess.run([executable("terrain_collider"), "--help"], capture_output=True, text=True, check=True)
    assert result.stdout.startswith("usage:") and result.stderr == ""
    assert all(spec.name in result.stdout for spec in SPECS)
    result = subprocess.run([executable("terrain_source"), "--hepl"], capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "--hepl" in result.stderr


def test_a_running_node_takes_its_own_dump(tmp_path: Path) -> None:
    """As `ros2 param dump` writes it and `ros2 param load` reads it: numbers without a point are texts there."""
    small = {"physics.solver_residual": 1e-9, "terrain.noise": 2e-5, "physics.gravity": [0.0, 1e-7, -9.81]}
    names = [spec.name for spec in SPECS if not spec.read_only]
    with made_with(TerrainCollider, small) as node:
        before, file = values(node, names), tmp_path / "dump.yaml"
        file.write_text(yaml.dump({"/terrain_collider": {"ros__parameters": before}}))
        loaded = [Parameter.from_parameter_msg(one) for one in parameter_dict_from_yaml_file(str(file)).values()]
        assert {one.name for one in loaded if one.type_ == Parameter.Type.STRING} >= small.keys()
        # As rclpy's services set them.
        assert [node.set_parameters_atomically([one]).reason for one in loaded] == [""] * len(names)
        assert values(node, names) == before
        for wrong in ("2e-5 m", "[1, 2]"):
            assert not node.set_parameters_atomically([Parameter("terrain.noise", value=wrong)]).successful
