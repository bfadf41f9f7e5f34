"""Launch files, RViz and aggregator files name what exists. Real ROS launch is not at hand everywhere: stand-ins record
what the files ask for."""

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parent.parent
LAUNCH_FILES = sorted((ROOT / "launch").glob("*.launch.py"))
EXECUTABLES = set(re.findall(r'f"(\w+) = \{NAME\}', (ROOT / "setup.py").read_text()))


class Recorded:
    """Anything a launch file makes, with what it was made of."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.args, self.kwargs = args, kwargs

    def everything(self) -> list["Recorded"]:
        found, todo = [], [self]
        while todo:
            item = todo.pop()
            if isinstance(item, Recorded):
                found.append(item)
                todo += [*item.args, *item.kwargs.values()]
            elif isinstance(item, list | tuple):
                todo += item
            elif isinstance(item, dict):
                todo += item.values()
        return found


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> dict[str, type[Recorded]]:
    kinds: dict[str, type[Recorded]] = {}
    for module, names in {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument", "SetEnvironmentVariable"),
        "launch.conditions": ("IfCondition",),
        "launch.substitutions": ("LaunchConfiguration", "PathJoinSubstitution"),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
        "launch_ros.substitutions": ("FindPackageShare",),
    }.items():
        made = ModuleType(module)
        for name in names:
            kinds[name] = type(name, (Recorded,), {})
            setattr(made, name, kinds[name])
        monkeypatch.setitem(sys.modules, module, made)
    return kinds


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_a_launch_file_names_what_exists(path: Path, stand_ins: dict[str, type[Recorded]]) -> None:
    description = runpy.run_path(str(path))["generate_launch_description"]()
    items = description.everything()

    def of(kind: str) -> list[Recorded]:
        return [item for item in items if type(item) is stand_ins[kind]]

    declared = {item.args[0] for item in of("DeclareLaunchArgument")}
    assert {item.args[0] for item in of("LaunchConfiguration")} == declared, "each is declared, each is used"
    assert all(item.kwargs["description"] for item in of("DeclareLaunchArgument"))
    for node in of("Node"):
        assert node.kwargs["package"] in ("smartmesh_ros", "rviz2")
        if node.kwargs["package"] == "smartmesh_ros":
            assert node.kwargs["executable"] in EXECUTABLES
    assert all(item.args == ("smartmesh_ros",) for item in of("FindPackageShare"))
    paths = [part for item in of("PathJoinSubstitution") for part in item.args[0] if isinstance(part, str)]
    files = {part for part in paths if part != "config"}
    assert all((ROOT / "config" / name).is_file() for name in files)


def test_rviz_shows_topics_of_the_node() -> None:
    view = yaml.safe_load((ROOT / "config" / "smartmesh.rviz").read_text())
    topics = [item["Topic"]["Value"] for item in view["Visualization Manager"]["Displays"] if "Topic" in item]
    readme = (ROOT / "README.md").read_text()
    assert topics
    assert all(topic.replace("/terrain_collider", "`~") + "`" in readme for topic in topics)


def test_the_aggregator_expects_the_statuses_that_there_are() -> None:
    aggregator = yaml.safe_load((ROOT / "config" / "diagnostic_aggregator.yaml").read_text())
    source = (ROOT / "smartmesh_ros" / "node" / "diagnostics.py").read_text()
    tasks = re.findall(r'_status\(node_name, "(\w+)"', source)
    expected = aggregator["/**"]["ros__parameters"]["terrain_collider"]["expected"]
    assert expected == [f"terrain_collider: {task}" for task in tasks]
