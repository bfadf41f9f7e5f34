"""The README's recipe for a ROS workspace, run by the real tools in an empty folder beside a package of the user's."""

import re
import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

from tests.newcomer.conftest import HERE, MESSAGES, ROOT, Workspace, build_command, recipe_line

ROSDEP = f"""
export ROS_DISTRO=jazzy ROS_PYTHON_VERSION=3 ROS_HOME=$PWD/ros_home ROSDEP_SOURCE_PATH=$PWD/rosdep_sources
export ROSDISTRO_INDEX_URL=file://{HERE}/rosdep/index-v4.yaml
mkdir -p rosdep_sources && echo "yaml file://{HERE}/rosdep/rules.yaml" >rosdep_sources/20-default.list
rosdep update --rosdistro jazzy >/dev/null &&
"""


def rosdep(workspace: Workspace, line: str) -> tuple[int, str]:
    """Exit code and words of a rosdep command, which only says what it would install on Ubuntu 24.04."""
    if shutil.which("rosdep") is None:
        pytest.skip("rosdep is not installed")
    command = line.replace("rosdep install", "rosdep install --simulate --os ubuntu:noble --rosdistro jazzy")
    result = workspace.run(ROSDEP + command, sourced=False, check=False)
    return result.returncode, result.stdout + result.stderr


def test_rosdep_finds_every_dependency_and_none_that_the_system_refuses(sources: Workspace) -> None:
    code, words = rosdep(sources, recipe_line("rosdep"))
    assert code == 0, words
    packages = set(re.findall(r"apt-get install -y (\S+)", words))
    optional = {"grid-map-msgs", "map-msgs", "simulation-interfaces", "tf2-msgs", "rviz2", "launch-ros"}
    assert {f"ros-jazzy-{name}" for name in optional} <= packages, words
    assert "pip3 install" not in words, "Ubuntu 24.04 lets nothing be installed by pip outside a virtual environment"


def test_without_the_link_both_folders_must_be_named(sources: Workspace, tmp_path: Path) -> None:
    """The other way of docs/installing.md, and as a control what the link is for."""
    (tmp_path / "src").mkdir()
    for name in ("smartmesh_ros", "my_robot"):
        (tmp_path / "src" / name).symlink_to(sources.folder / "src" / name)
    unlinked = Workspace(tmp_path)
    page = (ROOT / "docs" / "installing.md").read_text()
    [paths] = re.findall(r"`--from-paths (src src/\S+)`", page)
    assert re.findall(r"`--base-paths (src src/\S+)`", page) == [paths]
    line = recipe_line("rosdep")
    for folders, code, packages in (("src", 1, 2), (paths, 0, 3)):
        listed = unlinked.run(f"colcon list --names-only --base-paths {folders}", sourced=False).stdout.split()
        assert len(listed) == packages
        found, words = rosdep(unlinked, line.replace("--from-paths src", f"--from-paths {folders}"))
        assert found == code, words
        assert ("smartmesh_msgs" in words) == bool(code)


def test_every_import_of_a_package_of_ros_is_declared() -> None:
    declared = {item.text for item in ElementTree.parse(ROOT / "package.xml").getroot() if item.tag.endswith("depend")}
    imported, names = set(), r"rclpy|rosidl_\w+|launch\w*|ament_\w+|\w+_msgs|\w+_interfaces|\w+_srvs"
    for path in (ROOT / "smartmesh_ros").rglob("*.py"):
        imported |= set(re.findall(rf"^\s*(?:from|import) ({names})\b", path.read_text(), re.M))
    optional = {"grid_map_msgs", "map_msgs", "tf2_msgs", "simulation_interfaces"}  # imported by name
    assert imported | optional <= declared


def test_all_packages_are_built_and_the_scripts_run_under_the_python_that_built_them(workspace: Workspace) -> None:
    packages = workspace.run("python3 $(command -v colcon) list --names-only", sourced=False).stdout.split()
    assert {"my_robot", "smartmesh_msgs", "smartmesh_ros"} <= set(packages)
    script = workspace.folder / "install" / "smartmesh_ros" / "lib" / "smartmesh_ros" / "terrain_collider"
    python = workspace.run("command -v python3", sourced=False).stdout.strip()
    assert Path(script.read_text().splitlines()[0].removeprefix("#!")).samefile(python)


def test_a_user_takes_the_first_steps_with_a_package_of_his_own(workspace: Workspace) -> None:
    """See ``my_robot/first_steps.py``."""
    start = "ros2 run my_robot first_steps" if shutil.which("ros2") else "install/my_robot/lib/my_robot/first_steps"
    said = dict(line.split(": ", 1) for line in workspace.run(start).stdout.splitlines() if ": " in line)
    assert "terrain from ~/heightmap; physics 240 Hz" in said["start"]
    assert said["start"].count("[") == 3, "one line: level, time and name"
    assert said["bodies"] == "['ball']"
    assert said["ended"] == "True"


def test_the_demo_runs_in_a_domain_of_its_own(workspace: Workspace) -> None:
    demo = "install/smartmesh_ros/lib/smartmesh_ros/smartmesh-demo --seconds 2"
    said = workspace.run(f"env -u ROS_DOMAIN_ID {demo}").stdout
    assert re.search(r"DDS domain [1-9]\d*, a free one", said)
    assert "no body lost" in said


@pytest.mark.skipif(shutil.which("ros2") is None, reason="the ros2 command is not installed; tests/test_launch.py runs")
def test_launch_files_run_under_the_real_launch(workspace: Workspace) -> None:
    for file in ("collider", "terrain", "elevation_mapping"):
        assert "'preset'" in workspace.run(f"ros2 launch smartmesh_ros {file}.launch.py --show-args").stdout
    missing = workspace.run("ros2 launch smartmesh_ros collider.launch.py config:=/nowhere/mine.yaml", check=False)
    assert "there is no parameter file /nowhere/mine.yaml" in missing.stdout + missing.stderr


def test_a_changed_core_is_fresh_after_a_build_that_copies_and_one_that_links(workspace: Workspace) -> None:
    """Last, because the core that is left can nothing but answer: the whole one takes long to compile."""
    core = workspace.folder / "src" / "smartmesh_ros" / "smartmesh_ros" / "core"
    for source in core.glob("*/*.cpp"):
        source.write_text("")
    answering = '#include <nanobind/nanobind.h>\nNB_MODULE(_core, m) { m.attr("answer") = 42; }\n'
    (core / "python" / "bindings.cpp").write_text(answering)
    linked = workspace.folder / "linked"  # colcon refuses to link into a folder that it copied into
    linked.mkdir()
    (linked / MESSAGES).symlink_to(get_package_prefix(MESSAGES))
    linking = "--symlink-install --build-base linking --install-base linked"
    for installed, option, place in (("install", "", "install"), ("linked", linking, "src")):
        # Debug, which compiles in a third of the time.
        command = f"CMAKE_BUILD_TYPE=Debug {build_command()} --packages-select smartmesh_ros {option}"
        workspace.run(command, sourced=False)
        ask = "from smartmesh_ros.core import _core; print(_core.__file__, _core.answer)"
        command = f"source {installed}/setup.bash && python3 -c '{ask}'"
        library, answer = workspace.run(command, sourced=False).stdout.split()
        assert answer == "42"
        assert Path(library).resolve().is_relative_to(workspace.folder / place)
