"""Deployment by parameters: presets, help, files that say everything; and the node takes nothing from its own outputs:
else a robot's odometry becomes a tracked body inside that robot."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file, parameter_value_to_python

from smartmesh_ros.node.parameters.declaring import plain_value
from smartmesh_ros.node.parameters.helping import parameter_file
from smartmesh_ros.node.parameters.specifications import SPECS
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.tools.testing import COLLIDER, executable
from tests.launch_files import LAUNCH, Launch, Recorded, stand_ins
from tests.node.shared import Logged, made_with

__all__ = ["stand_ins"]

CONFIG = Path(__file__).parents[2] / "config"
# The last is of rclpy.
FIXED = {*(spec.name for spec in SPECS if spec.read_only), "start_type_description_service"}
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


def dump_of(node: TerrainCollider) -> dict[str, Any]:
    """What `ros2 param dump` is told of a node: every parameter that is set."""
    found = {name: node.get_parameter(name).get_parameter_value() for name in node.list_parameters([], 0).names}
    plain = {name: parameter_value_to_python(value) for name, value in found.items()}
    return {name: list(value) if hasattr(value, "tolist") else value for name, value in plain.items()}


def test_all_is_described_and_a_node_takes_its_own_dump_while_it_runs_and_at_the_next_start(
    tmp_path: Path, logged: Logged
) -> None:
    """As `ros2 param load` reads it, in whose files numbers without a point are texts."""
    small = {"physics.solver_residual": 1e-9, "terrain.noise": 2e-5, "physics.gravity": [0.0, 1e-7, -9.81]}
    changed = {**small, "physics.rate": 60.0, "raster.origin": [1.0, 2.0, 3.0], "terrain.changes": "correction"}
    file, dumps = tmp_path / "dump.yaml", []
    for arguments in ([], ["--params-file", str(file)]):
        with made_with(TerrainCollider, {} if arguments else changed, arguments) as node:
            check_descriptions(node)
            assert values(node, changed) == changed
            dumps.append(dump_of(node))
            file.write_text(yaml.safe_dump({COLLIDER: {"ros__parameters": dumps[-1]}}))
            loaded = [Parameter.from_parameter_msg(one) for one in parameter_dict_from_yaml_file(str(file)).values()]
            assert {one.name for one in loaded if one.type_ == Parameter.Type.STRING} >= small.keys()
            # As rclpy's services set them: one after the other.
            assert {one.name for one in loaded if not node.set_parameters_atomically([one]).successful} == FIXED
            assert dump_of(node) == dumps[0]
            for wrong in ("2e-5 m", "[1, 2]"):
                assert not node.set_parameters_atomically([Parameter("terrain.noise", value=wrong)]).successful
    assert dumps[0] == dumps[1] and {spec.name for spec in SPECS} <= dumps[0].keys()
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
