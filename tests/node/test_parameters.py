"""Parameters: presets, help, dumps, files that say everything; those that cannot be are refused at the start, with what
would be right. The node takes nothing from its own outputs: else a robot's odometry becomes a body inside the robot."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml
from rcl_interfaces.msg import ParameterType
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file, parameter_value_to_python

from smartmesh_ros.node.parameters.helping import answer, help_text, parameter_file
from smartmesh_ros.node.parameters.specifications import SPECS
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.tools.client import command
from smartmesh_ros.tools.testing import COLLIDER
from tests.launch_files import LAUNCH, Launch, Recorded, stand_ins
from tests.node.shared import Logged, made_with, refusal_at_start

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
    """Values of parameters."""
    return {name: node.get_parameter(name).value for name in names}


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
    changed |= {"robot.start": ["{id: spot, xy: [1, 2]}"], "bodies.urdf_folders": ["/"]}
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


def test_deleting_a_parameter_empties_a_list_and_is_refused_of_all_others() -> None:
    """`ros2 param delete`, and an empty list of `ros2 param load`, whose type nobody knows."""
    folders = "bodies.urdf_folders"
    with made_with(TerrainCollider, {folders: ["/"]}) as node:
        before = dump_of(node)
        refused = {spec.name for spec in SPECS if not node.set_parameters_atomically([Parameter(spec.name)]).successful}
        assert refused == {spec.name for spec in SPECS if spec.read_only or spec.default != []}
        assert dump_of(node) == before | {folders: []}
        assert node.set_parameters_atomically([Parameter("physics.rate", value=60.0)]).successful


@pytest.mark.parametrize("specs", [SPECS, []], ids=["all", "none"])
def test_a_printed_parameter_file_says_all_the_defaults(specs: Any, tmp_path: Path, logged: Logged) -> None:
    """Also that of a node without parameters can be read."""
    file = tmp_path / "printed.yaml"
    file.write_text(parameter_file("printed", specs))
    assert parameters_of(file) == {spec.name: spec.default for spec in specs if spec.default != []}
    assert all(spec.name in file.read_text() for spec in specs)
    with made_with(TerrainCollider, {}, ["--params-file", str(file)]) as node:
        assert node.values == {spec.name: spec.default for spec in SPECS}
    assert warnings(logged()) == []


def test_help_has_all_parameters_no_marks_of_code_and_no_empty_list(capsys: pytest.CaptureFixture[str]) -> None:
    """By an executable: test_start.py."""
    assert command.parser().description.startswith("smartmesh: ")
    with pytest.raises(SystemExit) as end:
        answer("rover", "The node ``rover``.", SPECS, ["--help"])
    text = capsys.readouterr().out
    assert end.value.code == 0 and text.startswith("usage:") and "The node rover." in text
    assert all(spec.name in text for spec in SPECS)
    assert "parameters:" not in help_text("rover", "", [])


MAPS = f"qos_overrides.{COLLIDER}/heightmap.subscription"


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"physics.rate": "fast"}, "physics.rate"),
        ({"terrain.motion": "jelly"}, "terrain.motion"),
        ({"physics.gravity": [0.0, 1.0]}, "gravity"),
        ({"use_sim_time": 3}, "use_sim_time"),
        ({"publish.clock": 10.0, "use_sim_time": True}, "use_sim_time"),
        ({"bodies.poses": ["rover=/a b"]}, "rover=/a b"),
        ({"bodies.odometry": ["a=/b"], "bodies.poses": ["/a"]}, "names body 'a' again"),
        ({"bodies.odometry": ["x/y=/b"]}, "no '/' in the name"),
        ({"bodies.poses": ["a={ns}/pose"]}, "'{ns}/pose' is no topic"),  # the node is in no namespace
        ({"bodies.peers": ["auto", "/a"]}, "alone"),
        ({"bodies.peers": ["a"]}, "starts with '/'"),
        ({"terrain.input": "lidar"}, "choose one of heightmap, grid_map"),
        ({"terrain.file": "/nowhere/map.npy"}, "there is no file /nowhere/map.npy"),
        ({"terrain.file": "package://no_such_pkg/map.npy"}, "'no_such_pkg' is not installed, or not sourced"),
        ({"bodies.urdf_folders": ["", "/"]}, "empty"),
        ({"bodies.urdf_folders": ["package://no_such_pkg"]}, "'no_such_pkg' is not installed, or not sourced"),
        ({"raster.origin": [0.0, 0.0]}, "three finite numbers"),
        ({"soil.type": ["lunar", "porridge"]}, "there is no soil 'porridge'"),
        ({"soil.type": ["lunar"], "terrain.changes": "correction"}, "terrain.changes"),
        ({"raster.material_layers": ["colour"]}, "colour"),
        ({"robot.description": "nowhere.urdf"}, f"{Path.cwd()}/nowhere.urdf"),
        ({"robot.description": "model://rover.urdf"}, "give a path, or a URI with file:// or package://"),
        ({"robot.start": ["{id: a}"]}, "xyz: [x, y, z]"),
        ({"robot.start": ["{id: a, xy: [0, 0]}", "{id: b, xy: [0, 0]}"]}, "2 entries"),
        ({"robot.start": []}, "0 entries"),
        ({"robot.start": "{id: a, xy: [0, 0]}"}, "robot.start"),
        ({"bodies.spawn": ["{id: x, urdf: /nowhere.urdf, xyz: [0, 0, 0]}"]}, "/nowhere.urdf"),
        # Quality of service.
        ({f"{MAPS}.reliability": "often"}, "reliable, best_effort"),
        ({f"{MAPS}.history": True}, "keep_last, keep_all"),
        ({f"{MAPS}.depth": 0}, "1 to"),
        ({f"{MAPS}.depth": "ten"}, "1 to"),
        ({f"{MAPS}.speed": 5}, "history, depth, reliability, durability"),
        ({f"qos_overrides.{COLLIDER}/heightmap.subscriber.depth": 5}, "publisher or subscription"),
        ({"qos_overrides.terrain_collider/heightmap.subscription.depth": 5}, "full name"),
        ({"qos_overrides.depth": 5}, "qos_overrides.<topic>"),
        # Lists of YAML mappings: what all have in common.
        ({"height_scans": ["robot"]}, "must be a mapping with body"),
        *(({"height_scans": [text]}, "is no YAML") for text in ("{body: robot", "{body: !!bool x}", "!!timestamp now")),
        ({"height_scans": ["{body: yes}"]}, "cannot name a body"),
        ({"height_scans": ["{body: robot/base}"]}, "without '/'"),
        ({"height_scans": ["{body: robot, rate: 0}"]}, "rate is 0; it must be of type float, 0.01 to 1000"),
        ({"height_scans": ["{body: a b}", "{body: a_b}"]}, "two entries for ~/height_scan/a_b"),
        ({"imus": ["{body: a, link: b c}", "{body: a, link: b_c}"]}, "two entries for ~/imu/a/b_c"),
        ({"decks": ["{deck: ferry, frame: a}"] * 2}, "two entries"),
        # And what is their own.
        ({"height_scans": ["{body: robot, layout: isaac_gym}"]}, "one of ('isaac_lab'"),
        ({"imus": ["{body: robot, link: [a]}"]}, "link is ['a']; it must be of type str"),
        ({"bases": ["{body: robot}"]}, "a base has wheels, with or without steering, or tracks"),
        ({"bases": ["{body: robot, wheels: [a, b], publish_tf: 1}"]}, "publish_tf is 1; it must be of type bool"),
        ({"bases": ["{body: robot, wheels: [a, b], odom_frame: ''}"]}, "odom_frame must not be empty"),
        ({"bases": [f"{{body: {name}, wheels: [a, b], publish_tf: true}}" for name in "ab"]}, "in one frame"),
        ({"bodies.shapes": ["{body: a}"]}, "it needs a shape and its size, or a urdf"),
        ({"bodies.shapes": ["{body: a, urdf: x, size: [1]}"]}, "it needs a shape and its size, or a urdf"),
        ({"bodies.shapes": ["{body: a, urdf: /nowhere.urdf}"]}, "/nowhere.urdf"),
        ({"bodies.spawn": ["{id: x, shape: spere, size: [1], xy: [0, 0]}"]}, "no shape 'spere'; did you mean 'sphere'"),
        ({"bodies.spawn": ["{id: x, xy: [0, 0]}"]}, "needs a shape (sphere, box, cylinder, capsule) and its size"),
        ({"bodies.spawn": ["{id: x, shape: box, size: 1, xy: [0, 0]}"]}, "size must be a list of numbers in metres"),
        ({"bodies.spawn": ["{id: x, urdf: a, mas: 3, xy: [0, 0]}"]}, "'mas' is unknown; did you mean 'mass'?"),
        ({"bodies.spawn": ["{id: x, urdf: a, shape: box, mass: 3, xy: [0, 0]}"]}, "of its urdf; leave out shape, mass"),
        ({"bodies.spawn": ["{id: x, urdf: a, yaw: .inf, xy: [0, 0]}"]}, "mass and yaw must be finite numbers"),
        ({"bodies.spawn": ["{id: x, urdf: a, xy: [.nan, 0]}"]}, "with clearance or above, all of them finite"),
        ({"bodies.spawn": [f"{{id: x, urdf: a, xy: [1{'0' * 400}, 0]}}"]}, "all of them finite"),
        ({"bodies.spawn": [f"{{id: x, shape: sphere, size: [1{'0' * 400}], xy: [0, 0]}}"]}, "too large"),
        ({"bodies.spawn": ["{id: x, urdf: a, xy: [0, 0], align: maybe}"]}, "align is 'maybe'; it must be"),
        ({"bodies.spawn": ["{id: a/b, urdf: a, xy: [0, 0]}"]}, "cannot name a body; a name is printable text"),
        ({"bodies.spawn": ["{id: x, urdf: a, xy: [0]}"]}, "xy: [x, y] with clearance or above"),
        ({"bodies.spawn": ["{id: x, urdf: a, xyz: [0, 0, 0], align: true}"]}, "clearance and align go with xy alone"),
        ({"ground_maps": ["{body: x, spacing: 0}"]}, "spacing: 0}': the spacing is 0.0; it must be above 0"),
        ({"decks": ["{deck: ferry}"]}, "frame, odometry, body"),
        ({"decks": ["{deck: ferry, frame: a, body: b}"]}, "frame, odometry, body"),
        ({"decks": ["{deck: ferry, frame: a, link: b}"]}, "a link is that of a body"),
        ({"decks": ["{deck: ferry, odometry: 'no topic'}"]}, "odometry"),
        ({"decks": ["{deck: ferry, frame: a, thickness: 0}"]}, "the thickness is a number of metres above zero"),
        ({"decks": ["{deck: ferry, frame: a, rpy: [0, 0, .inf]}"]}, "rpy must be three finite numbers"),
    ],
)
def test_what_cannot_be_is_refused_at_the_start(parameters: dict[str, Any], words: str) -> None:
    refusal = refusal_at_start(parameters)
    name, *_ = parameters
    assert words in refusal and name in refusal


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"publish.tf": 10.0}, "publish.tf needs tf2_msgs/msg/TFMessage"),
        ({"terrain.input": "grid_map"}, "needs grid_map_msgs/msg/GridMap"),
    ],
)
def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, parameters: dict[str, Any], words: str) -> None:
    monkeypatch.setattr("smartmesh_ros.node.inputs.optional_messages.find_interfaces", lambda *_: None)
    said, package = refusal_at_start(parameters), words.split()[-1].partition("/")[0].replace("_", "-")
    assert words in said and f"apt install ros-jazzy-{package}" in said


@pytest.mark.parametrize(
    ("parameters", "remap", "words"),
    [
        ({"bodies.odometry": ["husky=~/odometry"]}, [], ("body 'husky'", "'~/odometry'", f"{COLLIDER}/odometry")),
        ({}, ["~/tracked_bodies:=/bodies", "~/body_states:=/bodies"], ("~/tracked_bodies", "/bodies", "~/body_states")),
        ({}, ["~/joint_commands:=~/joint_states"], ("~/joint_commands", "publishes as ~/joint_states")),
    ],
)
def test_an_input_on_a_topic_that_the_node_publishes_is_refused_with_both_named(
    parameters: dict[str, Any], remap: list[str], words: tuple[str, ...]
) -> None:
    reason = refusal_at_start(parameters, [part for rule in remap for part in ("-r", rule)])
    assert all(word in reason for word in words), reason
