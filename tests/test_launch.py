"""Launch files, RViz and aggregator files name what exists. Real ROS launch is not at hand everywhere: stand-ins record
what the files ask for."""

import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parent.parent
LAUNCH_FILES = sorted((ROOT / "launch").glob("*.launch.py"))
FLEET = ROOT / "launch" / "fleet.launch.py"
EXECUTABLES = set(re.findall(r'f"(\w+) = \{NAME\}', (ROOT / "setup.py").read_text()))
ARGUMENTS = {"preset", "config", "namespace", "use_sim_time", "log_level", "rviz", "dds"}


class Recorded:
    """Anything a launch file makes, with what it was made of."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.args, self.kwargs = args, kwargs

    def perform(self, context: dict[str, str]) -> str:
        """As of a LaunchConfiguration: the value of the argument of its name."""
        return context[self.args[0]]


class Launch:
    """A launch file, as far as it can be taken apart without ROS launch."""

    def __init__(self, path: Path, kinds: dict[str, type[Recorded]]) -> None:
        [self._items] = runpy.run_path(str(path))["generate_launch_description"]().args
        self._kinds = kinds
        declared = [item for item in self._items if type(item) is kinds["DeclareLaunchArgument"]]
        assert all(item.kwargs["description"].endswith(".") for item in declared)
        self.defaults = {item.args[0]: item.kwargs["default_value"] for item in declared}

    def of(self, kind: str, **arguments: str) -> list[Recorded]:
        """What it makes of a kind with these arguments and the defaults of the others."""
        assert set(arguments) <= set(self.defaults)
        items = [item for item in self._items if type(item) is not self._kinds["OpaqueFunction"]]
        for item in self._items[len(items) :]:
            items += item.kwargs["function"]({**self.defaults, **arguments})
        return [item for item in items if type(item) is self._kinds[kind]]


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Recorded]]:
    kinds: dict[str, type[Recorded]] = {}
    for module, names in {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction", "SetEnvironmentVariable"),
        "launch.substitutions": ("LaunchConfiguration",),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
    }.items():
        made = ModuleType(module)
        for name in names:
            kinds[name] = type(name, (Recorded,), {})
            setattr(made, name, kinds[name])
        monkeypatch.setitem(sys.modules, module, made)
    monkeypatch.delitem(sys.modules, "smartmesh_ros.launching", raising=False)
    monkeypatch.delenv("FASTRTPS_DEFAULT_PROFILES_FILE", raising=False)
    return kinds


@pytest.fixture
def fleet(stand_ins: dict[str, type[Recorded]]) -> Iterator[Launch]:
    yield Launch(FLEET, stand_ins)
    sys.modules.pop("smartmesh_ros.launching", None)


@pytest.fixture(params=[path for path in LAUNCH_FILES if path != FLEET], ids=lambda path: path.name)
def launch(request: pytest.FixtureRequest, stand_ins: dict[str, type[Recorded]]) -> Iterator[Launch]:
    yield Launch(request.param, stand_ins)
    sys.modules.pop("smartmesh_ros.launching", None)  # it is made of stand-ins


def test_all_launch_files_have_the_same_arguments_and_start_what_exists(launch: Launch) -> None:
    assert set(launch.defaults) >= ARGUMENTS
    for node in launch.of("Node", rviz="true"):
        assert node.kwargs["package"] in ("smartmesh_ros", "rviz2")
        if node.kwargs["package"] == "smartmesh_ros":
            assert node.kwargs["executable"] in EXECUTABLES
    assert len(launch.of("Node", rviz="true")) == len(launch.of("Node")) + 1


def test_defaults_are_those_of_the_node(launch: Launch) -> None:
    collider, *_ = launch.of("Node")
    *files, last = collider.kwargs["parameters"]
    assert {Path(file).stem for file in files} <= {"elevation_mapping"}
    assert last == {"use_sim_time": False}
    assert collider.kwargs["namespace"] == ""
    variables = {item.args[0]: item.args[1] for item in launch.of("SetEnvironmentVariable")}
    assert Path(variables["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()
    assert launch.of("SetEnvironmentVariable", dds="") == []


def test_arguments_reach_every_node(launch: Launch, tmp_path: Path) -> None:
    config = tmp_path / "mine.yaml"
    config.write_text("/**: {ros__parameters: {physics.rate: 100.0}}")
    nodes = launch.of("Node", namespace="robot", use_sim_time="true", config=str(config), preset="rover", rviz="true")
    assert all(node.kwargs["parameters"][-1]["use_sim_time"] for node in nodes)
    *ours, rviz = sorted(nodes, key=lambda node: node.kwargs["package"] == "rviz2")
    assert all(node.kwargs["namespace"] == "robot" for node in ours)
    assert ("/terrain_collider/patches", "/robot/terrain_collider/patches") in rviz.kwargs["remappings"]
    *_, preset, mine, _ = launch.of("Node", config=str(config), preset="rover")[0].kwargs["parameters"]
    assert (Path(preset).name, mine) == ("rover.yaml", str(config)), "the user's file is read last, and wins"


@pytest.mark.parametrize("arguments", [{"config": "/nowhere/mine.yaml"}, {"preset": "rovr"}])
def test_a_file_that_does_not_exist_ends_the_launch_with_its_path(launch: Launch, arguments: dict[str, str]) -> None:
    with pytest.raises(FileNotFoundError, match=r"/nowhere/mine.yaml|config/rovr.yaml; the presets are .*rover"):
        launch.of("Node", **arguments)


def test_a_fleet_shares_terrain_and_patches_and_knows_its_peers(fleet: Launch) -> None:
    assert set(fleet.defaults) >= ARGUMENTS
    *colliders, front, source, rviz = fleet.of("Node", nodes="3", namespace="site", rviz="true", use_sim_time="true")
    names = [f"/site/fleet/node_{index}/terrain_collider" for index in range(3)]
    assert [f"{node.kwargs['namespace']}/terrain_collider" for node in colliders] == names
    for node, name in zip(colliders, names, strict=True):
        preset, own, time = node.kwargs["parameters"]
        assert Path(preset).name == "fleet.yaml"
        assert {name, *own["bodies.peers"]} == set(names)
        assert time == {"use_sim_time": True}
        assert ("~/heightmap", "/site/fleet/heightmap") in node.kwargs["remappings"]
        assert ("~/patches", "/site/fleet/patches") in node.kwargs["remappings"]
    assert len({node.kwargs["parameters"][1]["publish.marker_namespace"] for node in colliders}) == 3
    assert front.kwargs["parameters"][0]["nodes"] == names
    assert front.kwargs["namespace"] == source.kwargs["namespace"] == "site"
    assert ("terrain_collider/heightmap", "/site/fleet/heightmap") in source.kwargs["remappings"]
    assert ("/terrain_collider/patches", "/site/fleet/patches") in rviz.kwargs["remappings"]
    assert {node.kwargs["executable"] for node in (*colliders, front, source)} <= EXECUTABLES
    assert len(fleet.of("Node", nodes="1", scene="")) == 2


def test_rviz_shows_topics_of_the_node() -> None:
    view = yaml.safe_load((ROOT / "config" / "smartmesh.rviz").read_text())
    topics = [item["Topic"]["Value"] for item in view["Visualization Manager"]["Displays"] if "Topic" in item]
    readme = (ROOT / "docs" / "interface.md").read_text()
    assert topics
    assert all(topic.replace("/terrain_collider", "`~") + "`" in readme for topic in topics)


def test_the_aggregator_expects_the_statuses_that_there_are() -> None:
    aggregator = yaml.safe_load((ROOT / "config" / "diagnostic_aggregator.yaml").read_text())
    source = (ROOT / "smartmesh_ros" / "node" / "diagnostics.py").read_text()
    tasks = re.findall(r'_status\(node_name, "(\w+)"', source)
    expected = aggregator["/**"]["ros__parameters"]["terrain_collider"]["expected"]
    assert expected == [f"terrain_collider: {task}" for task in tasks]
