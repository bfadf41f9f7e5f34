"""Launch files, RViz and aggregator files name what exists."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from ament_index_python.packages import get_package_prefix

from tests.launch_files import LAUNCH, Launch, Recorded, stand_ins

__all__ = ["stand_ins"]

ROOT = LAUNCH.parent
LAUNCH_FILES = sorted(LAUNCH.glob("*.launch.py"))
FLEET = LAUNCH / "fleet.launch.py"
of_one_collider = pytest.mark.parametrize(
    "launch", [path for path in LAUNCH_FILES if path != FLEET], ids=lambda path: path.name, indirect=True
)
EXECUTABLES = {path.name for path in Path(get_package_prefix("smartmesh_ros"), "lib", "smartmesh_ros").iterdir()}
ARGUMENTS = {"preset", "config", "namespace", "use_sim_time", "log_level", "rviz", "dds"}


@pytest.fixture
def rviz(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package of that name, which the launch files look up."""
    for file in ("share/ament_index/resource_index/packages/rviz2", "lib/rviz2/rviz2"):
        (tmp_path / file).parent.mkdir(parents=True)
        (tmp_path / file).touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:{get_package_prefix('smartmesh_ros')}")


@pytest.fixture
def fleet(stand_ins: dict[str, type[Recorded]]) -> Launch:
    return Launch(FLEET, stand_ins)


@pytest.fixture(params=LAUNCH_FILES, ids=lambda path: path.name)
def launch(request: pytest.FixtureRequest, stand_ins: dict[str, type[Recorded]]) -> Launch:
    return Launch(request.param, stand_ins)


def test_all_launch_files_have_the_same_arguments_and_start_what_exists(launch: Launch, rviz: None) -> None:
    assert set(launch.defaults) >= ARGUMENTS
    for node in launch.of("Node", rviz="true"):
        assert node.kwargs["package"] in ("smartmesh_ros", "rviz2")
        if node.kwargs["package"] == "smartmesh_ros":
            assert node.kwargs["executable"] in EXECUTABLES
    assert len(launch.of("Node", rviz="true")) == len(launch.of("Node")) + 1


@of_one_collider
def test_defaults_are_those_of_the_node(launch: Launch) -> None:
    collider, *_ = launch.of("Node")
    own = collider.kwargs["parameters"]
    given = [each for each in own if isinstance(each, dict)]
    frames, soil = [{"publish.tf": 50.0}], [{"soil.type": ["dry_sand"], "soil.slip_sinkage": True}]
    assert given in ([], frames, soil), "frames for RViz, at once; no empty file, which the node would name"
    assert {Path(each).stem for each in own if each not in given} <= {"bodies", "elevation_mapping"}
    assert collider.kwargs["namespace"] == ""
    variables = {item.args[0]: item.args[1] for item in launch.of("SetEnvironmentVariable")}
    assert Path(variables["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()
    assert launch.of("SetEnvironmentVariable", dds="") == []


def test_time_is_set_where_the_argument_asks_for_it(launch: Launch, rviz: None) -> None:
    """Otherwise what an outer launch file sets, as by SetParameter, would be overridden."""

    def times(**arguments: str) -> set[Any]:
        nodes = launch.of("Node", rviz="true", **arguments)
        found = [{key: v for part in node.kwargs["parameters"] if isinstance(part, dict) for key, v in part.items()}
                 for node in nodes]  # fmt: skip
        return {parameters.get("use_sim_time") for parameters in found}

    assert times() == {None}
    assert times(use_sim_time="true") == {True}
    assert times(use_sim_time="false") == {False}


@of_one_collider
def test_arguments_reach_every_node(launch: Launch, tmp_path: Path, rviz: None) -> None:
    config = tmp_path / "mine.yaml"
    config.write_text("/**: {ros__parameters: {physics.rate: 100.0}}")
    given = {"namespace": "robot", "log_level": "warn", "preset": "rover", "rviz": "true"}
    nodes = launch.of("Node", **given, config=str(config))
    *ours, rviz = sorted(nodes, key=lambda node: node.kwargs["package"] == "rviz2")
    assert all(node.kwargs["namespace"] == "robot" for node in ours)
    assert all(node.kwargs["arguments"] == ["--ros-args", "--log-level", "warn"] for node in ours)
    for topic in ("patches", "scene", "robot_model"):
        assert (f"/terrain_collider/{topic}", f"/robot/terrain_collider/{topic}") in rviz.kwargs["remappings"]
    *_, preset, mine = launch.of("Node", config=str(config), preset="rover")[0].kwargs["parameters"]
    assert (Path(preset).name, mine) == ("rover.yaml", str(config)), "the user's file is read last, and wins"


@pytest.mark.parametrize(
    "arguments", [{"config": "/nowhere/mine.yaml"}, {"preset": "rovr"}, {"dds": "/nowhere/mine.yaml"}]
)
def test_a_file_that_does_not_exist_ends_the_launch_with_its_path(launch: Launch, arguments: dict[str, str]) -> None:
    presets = [path.stem for path in (ROOT / "config").glob("*.yaml") if "terrain_collider:" not in path.read_text()]
    with pytest.raises(
        FileNotFoundError, match=r"/nowhere/mine.yaml|config/rovr.yaml; the presets are [\w, ]+$"
    ) as error:
        launch.of("Node", **arguments)
    assert "preset" not in arguments or {*str(error.value).rpartition(" are ")[2].split(", ")} == {*presets}


def test_a_tilde_is_the_home_in_every_path(launch: Launch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shell leaves it in dds:=~/mine.xml."""
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("mine.xml", "mine.yaml"):
        (tmp_path / name).touch()
    profile, _ = launch.of("SetEnvironmentVariable", dds="~/mine.xml")
    assert profile.args[1] == str(tmp_path / "mine.xml")
    assert str(tmp_path / "mine.yaml") in launch.of("Node", config="~/mine.yaml")[0].kwargs["parameters"]


def test_an_argument_that_means_nothing_ends_the_launch(
    launch: Launch, fleet: Launch, stand_ins: dict[str, type[Recorded]]
) -> None:
    soil = Launch(LAUNCH / "soil.launch.py", stand_ins)
    wrong = [(launch, "rviz", "ture"), (launch, "use_sim_time", "maybe"), (soil, "rover", "1x")]
    wrong += [(fleet, "nodes", given) for given in ("two", "0", "-1", "2.5", "")]
    for which, name, given in wrong:
        with pytest.raises(ValueError, match=f"^{name}:={given} is "):
            which.of("Node", **{name: given})
    assert fleet.declared["spread"].kwargs["choices"] == ("fewest", "tiles")
    assert fleet.declared["respawn"].kwargs["choices"] == ("elsewhere", "same")


def test_without_rviz_nothing_is_started(launch: Launch, monkeypatch: pytest.MonkeyPatch) -> None:
    """ROS launch starts actions in their order and looks each executable up when its turn comes."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", get_package_prefix("smartmesh_ros"))
    with pytest.raises(FileNotFoundError, match="rviz2 has no executable rviz2; apt install ros-jazzy-rviz2"):
        launch.of("Node", rviz="true")
    assert launch.of("Node", rviz="false")


def test_a_fleet_shares_terrain_and_patches_and_knows_its_peers(fleet: Launch, rviz: None) -> None:
    *colliders, front, source, rviz = fleet.of("Node", nodes="3", namespace="site", rviz="true", use_sim_time="true")
    names = [f"/site/fleet/node_{index}/terrain_collider" for index in range(3)]
    assert [f"{node.kwargs['namespace']}/terrain_collider" for node in colliders] == names
    for node, name in zip(colliders, names, strict=True):
        preset, own, time = node.kwargs["parameters"]
        assert Path(preset).name == "fleet.yaml"
        assert {name, *own["bodies.peers"]} == set(names)
        assert time == {"use_sim_time": True}
        assert ("~/heightmap", "/site/fleet/heightmap") in node.kwargs["remappings"]
        for topic in ("patches", "scene"):
            assert (f"~/{topic}", f"/site/fleet/{topic}") in node.kwargs["remappings"]
    assert front.kwargs["parameters"][0]["nodes"] == names
    assert front.kwargs["namespace"] == source.kwargs["namespace"] == "site"
    assert ("terrain_collider/heightmap", "/site/fleet/heightmap") in source.kwargs["remappings"]
    assert ("/terrain_collider/patches", "/site/fleet/patches") in rviz.kwargs["remappings"]
    assert len(fleet.of("Node", nodes="1", scene="")) == 2


def test_a_namespace_that_an_outer_launch_file_pushes_is_that_of_all_names(launch: Launch, rviz: None) -> None:
    """The peers of a fleet, its front and what RViz shows have full names, to which ROS launch adds nothing."""

    def made(**arguments: str) -> list[Any]:
        nodes = launch.of("Node", rviz="true", **arguments)
        kept = [
            (node.kwargs.get("namespace", ""), node.kwargs.get("remappings"), str(node.kwargs["parameters"]))
            for node in nodes
        ]
        return [(space.strip("/"), *more) for space, *more in kept]

    assert made(ros_namespace="/alpha") == made(namespace="alpha")
    assert made(ros_namespace="alpha", namespace="b") == made(namespace="alpha/b")
    assert made(ros_namespace="alpha", namespace="/b") == made(namespace="b")


def test_the_rover_comes_when_it_is_asked_for(stand_ins: dict[str, type[Recorded]]) -> None:
    launch = Launch(LAUNCH / "soil.launch.py", stand_ins)
    kinds = [node.kwargs["executable"] for node in launch.of("Node")]
    assert kinds == ["terrain_collider"]
    assert [node.kwargs["executable"] for node in launch.of("Node", rover="true")] == [*kinds, "rover"]
    [collider] = launch.of("Node", soil="clay, lunar", preset="fast")
    own, preset = collider.kwargs["parameters"]
    assert own == {"soil.type": ["clay", "lunar"], "soil.slip_sinkage": True}
    assert Path(preset).name == "fast.yaml"


def test_rviz_shows_topics_of_the_node() -> None:
    view = yaml.safe_load((ROOT / "config" / "smartmesh.rviz").read_text())
    displays = view["Visualization Manager"]["Displays"]
    topics = [item[key]["Value"] for item in displays for key in ("Topic", "Description Topic") if key in item]
    readme = (ROOT / "docs" / "interface.md").read_text()
    assert topics
    assert all(topic.replace("/terrain_collider", "`~") + "`" in readme for topic in topics)


def test_the_aggregator_expects_the_statuses_that_there_are() -> None:
    aggregator = yaml.safe_load((ROOT / "config" / "diagnostic_aggregator.yaml").read_text())
    source = (ROOT / "smartmesh_ros" / "node" / "outputs" / "diagnostics.py").read_text()
    tasks = re.findall(r'_status\(node_name, "(\w+)"', source)
    expected = aggregator["/**"]["ros__parameters"]["terrain_collider"]["expected"]
    assert expected == [f"terrain_collider: {task}" for task in tasks]
