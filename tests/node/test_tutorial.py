"""The tutorials do what they say: their files and commands are taken from the pages and run."""

import math
import re
import shlex
import subprocess
import sys
import unittest
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet_data
import pytest
import yaml
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, PointCloud2
from smartmesh_msgs.srv import QueryGround, SpawnBody
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.client import command
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import Probe, Process, heightmap_message, pose_message
from tests.grid_maps import grid_map_message
from tests.grounds import patch_of
from tests.launch_files import Recorded, stand_ins
from tests.node.shared import ROOT, blocks, fed, running, stamped, transform_message, wait_until
from tests.urdfs import HUSKY, joint, link, robot

__all__ = ["stand_ins"]

RESOLUTION = 0.1


def arguments_of(command: str) -> list[str]:
    """Arguments for ROS of a command that starts a collider."""
    words = shlex.split(command.replace("\\\n", " "))
    assert words[:5] == ["ros2", "run", "smartmesh_ros", "terrain_collider", "--ros-args"]
    return words[5:]


def ground(x: Any, y: Any) -> Any:
    return 0.2 * np.sin(x) + 0.1 * np.asarray(y)


def commands(language: str, beginning: str) -> list[list[str]]:
    """The commands of all pages that begin so, as words, without comments; each once."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    found = [block for page in pages for block in blocks(str(page.relative_to(ROOT)), language)]
    lines = "\n".join(found).replace("\\\n", " ").splitlines()
    words = [tuple(shlex.split(line, comments=True)) for line in lines if line.startswith(beginning)]
    return [list(each) for each in dict.fromkeys(words)]


def test_the_sensors_of_the_pages_see_the_ground_around_the_robot_of_the_launch(probe: Probe) -> None:
    """`terrain.launch.py` starts a collider with these bodies."""
    clouds = probe.listen("/terrain_sensor/points", PointCloud2)
    found = commands("console", "ros2 run smartmesh_ros terrain_sensor")
    assert len(found) >= 2
    with probe.running(arguments=["--ros-args", "--params-file", str(ROOT / "config/bodies.yaml"), "--"]):
        probe.publish_map(np.zeros((101, 101)), origin=(-5.0, -5.0, 0.0))
        for words in found:
            clouds.clear()
            with Process("terrain_sensor", arguments=words[4:]):
                probe.wait_for(lambda: any(cloud.width > 100 for cloud in clouds))
            assert {cloud.header.frame_id for cloud in clouds} == {"husky"}


def test_the_pages_commands_of_smartmesh_are_ones() -> None:
    found = commands("bash", "smartmesh ")
    assert len(found) >= 4
    for words in found:
        # What follows the name of an executable is its own.
        command.parser().parse_args(words[1:3] if words[1] == "run" else words[1:])


def the_walk(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], str, str]:
    """Goes into an empty folder and makes the map of the first page there; returns its parameters and two programs."""
    monkeypatch.chdir(folder)
    [hill, driver, bag], [file] = blocks("docs/index.md", "python"), blocks("docs/index.md", "yaml")
    exec(compile(hill, "hill.py", "exec"), {})
    return yaml.safe_load(file)["/**"]["ros__parameters"], driver, bag


def test_the_walk_of_the_first_page_leads_over_the_hill_again_in_a_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters, _, bag = the_walk(tmp_path, monkeypatch)
    assert parameters["service_introspection"] == "contents", "or the bag would have no robot"
    exec(compile(bag, "bag.py", "exec"), {})
    with Replay("my_bag", parameters) as run:
        run.run()
        assert not run.refused
        assert run.world.state("rover").position[2] > 0.75


def test_the_program_of_the_first_page_drives_the_robot(
    probe: Probe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters, driver, _ = the_walk(tmp_path, monkeypatch)
    odometry = probe.listen("/terrain_collider/odom/rover", Odometry)
    with probe.running("terrain_collider", parameters | {"terrain.file": str(tmp_path / "hill.npy")}):
        assert probe.call("spawn_body", SpawnBody, id="rover", urdf=HUSKY, on_ground=True).success
        with running(driver):
            probe.wait_for(lambda: odometry and odometry[-1].twist.twist.linear.x > 0.4)


def test_the_posture_of_the_page_lets_a_robot_on_legs_stand_after_a_reset(probe: Probe) -> None:
    [posture] = [code for code in blocks("docs/robots.md", "python") if "POSTURE" in code]
    readings, states = probe.listen("joint_states", JointState), probe.listen("odometry", Odometry)
    legs = {"id": "a1", "urdf": f"{pybullet_data.getDataPath()}/a1/a1.urdf", "on_ground": True}
    with probe.running("terrain_collider"):
        probe.publish_map(np.zeros((81, 81)), origin=(-4.0, -4.0, 0.0))
        assert probe.call("spawn_body", SpawnBody, **legs).success
        probe.wait_for(lambda: states and states[-1].pose.pose.position.z < 0.2)  # it has fallen
        with running(posture):
            knee = readings[-1].name.index("FL_lower_joint")

            def bent() -> bool:
                return abs(readings[-1].position[knee] + 1.6) < 0.1

            probe.wait_for(bent)
            assert probe.call("reset", Trigger).success
            probe.wait_for(lambda: bent() and 0.2 < states[-1].pose.pose.position.z < 0.35)


def test_the_readmes_publisher_moves_the_ground(probe: Probe) -> None:
    _, code = blocks("README.md", "python")
    with probe.running("terrain_collider"), running(code):
        probe.wait_for(lambda: probe.diagnostics("terrain")["message"] == "maps arrive")
        asked = {"x": [0.0], "y": [0.0]}
        probe.wait_for(lambda: abs(probe.call("query_ground", QueryGround, **asked).velocities[2]) > 0.1)
        assert probe.diagnostics("inputs")["message"] == "0 refused so far"


def test_the_tests_of_the_page_on_testing_run_in_a_package_of_ones_own(tmp_path: Path) -> None:
    conftest, *tests = blocks("docs/testing.md", "python")
    (tmp_path / "conftest.py").write_text(conftest)
    for number, text in enumerate(tests):
        (tmp_path / f"test_mine_{number}.py").write_text(text)
    command = [*f"{sys.executable} -m pytest -q -p no:cacheprovider --rootdir".split(), str(tmp_path), str(tmp_path)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
    assert f"{len(tests)} passed" in result.stdout


def test_the_test_of_the_page_for_launch_testing_passes(
    probe: Probe, stand_ins: dict[str, type[Recorded]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the node that its launch file asks for; ROS launch is not at hand everywhere."""
    made = ModuleType("launch_testing.actions")
    made.ReadyToTest = type("ReadyToTest", (Recorded,), {})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "launch_testing", ModuleType("launch_testing"))
    monkeypatch.setitem(sys.modules, "launch_testing.actions", made)
    for name in ("launch_ros", "launch_testing"):
        monkeypatch.setattr(sys.modules[name], "actions", sys.modules[f"{name}.actions"], raising=False)
    [code] = blocks("docs/testing.md", "py")
    page: dict[str, Any] = {"__name__": "test_ball"}
    exec(compile(code, "test_ball.py", "exec"), page)
    [[node, _]] = page["generate_test_description"]().args
    with probe.running(node.kwargs["executable"], *node.kwargs["parameters"], package=node.kwargs["package"]):
        found = unittest.TestResult()
        unittest.defaultTestLoader.loadTestsFromTestCase(page["TestBall"]).run(found)
    assert found.testsRun == 1 and not found.errors and not found.failures, found


def test_what_the_page_on_testing_names_is_there() -> None:
    from smartmesh_ros.tools import testing

    page = (ROOT / "docs" / "testing.md").read_text()
    table = page[page.index("## What there is") : page.index("The vertices of a patch")]
    methods, messages = re.findall(r"probe\.(\w+)", table), re.findall(r"`(\w+_message)`", table)
    assert methods and messages
    assert all(hasattr(testing.Probe, method) or method == "received" for method in methods)
    assert all(hasattr(testing, name) for name in ("domain", "probe", "replay", "Process", "assert_on_map", *messages))


# Maps of the form that the ROS 2 release of elevation_mapping_cupy sends: a square of cells around the robot, in layers
# of float32 whose columns are contiguous; the buffer always starts at zero; unseen heights are NaN, while unseen cells
# have a variance of 1000; the middle of the map is given as the position of the robot, although the cells lie at whole
# multiples of the resolution. The side of its example [cells]:
SIDE = 150
UNSEEN = 1000.0  # its variance of cells without a measurement [m^2]
# By which the ground may be off where the middle is off by half a cell along x and y, on slopes of `ground` [m].
HALF_CELL = 0.5 * RESOLUTION * (0.2 + 0.1)


def cells_around(x: float, y: float) -> tuple[FloatArray, FloatArray]:
    """Positions of the cells (rows along +y, columns along +x) of a map that follows a robot by whole cells."""
    rows, columns = (np.mgrid[:SIDE, :SIDE] - 0.5 * (SIDE - 1)) * RESOLUTION
    middle = np.round(np.array([x, y]) / RESOLUTION) * RESOLUTION
    return middle[0] + columns, middle[1] + rows


def cupy_map(x: float, y: float, *, seen: bool = True) -> GridMap:
    """A map of its publisher elevation_map_raw."""
    heights = ground(*cells_around(x, y))
    variances = np.full_like(heights, 1e-4 if seen else UNSEEN)
    layers = {"elevation": np.where(seen, heights, np.nan), "variance": variances}
    return grid_map_message(layers, RESOLUTION, (x, y, 0.0))


def test_an_elevation_map_becomes_patches_under_the_robot(tmp_path: Path) -> None:
    """The map is in ``map``, the odometry in ``odom``, which lies 10 m further along y."""
    file, _ = blocks("docs/elevation_mapping.md", "yaml")
    assert yaml.safe_load(file) == yaml.safe_load((ROOT / "config/elevation_mapping.yaml").read_text()), "as installed"
    command, *_ = blocks("docs/elevation_mapping.md", "console")
    (tmp_path / "my_robot.yaml").write_text(file)
    with fed({}, arguments_of(command.replace("my_robot.yaml", str(tmp_path / "my_robot.yaml")))) as node:
        for x, seen in ((0.0, False), (0.0, True), (0.033, True), (0.31, True), (1.248, True)):
            node.give("/elevation_mapping/elevation_map", stamped(node, cupy_map(x, 0.2, seen=seen)), steps=240)
            odometry = Odometry(child_frame_id="base_link")
            odometry.pose.pose = pose_message((x, -9.8, float(ground(x, 0.2)) + 0.3))
            if not seen:
                node.give("/odom", stamped(node, odometry, "odom"))
                assert np.isnan(node.heights(x, 0.2))
                continue
            place = transform_message(node, "map", "odom", (0.0, 10.0, 0.0))
            node.give("/tf", TFMessage(transforms=[place]))
            odometry.header.frame_id, odometry.header.stamp = "odom", place.header.stamp  # however long the steps took
            node.give("/odom", odometry)
            patches = node.world.patches().table()
            assert [patches.slots[0]] == [*patches.slots]
            points = patch_of(patches, 0)[0]
            assert np.abs(points[:, :2].mean(axis=0) - (x, 0.2)).max() < 0.2
            assert np.abs(points[:, 2] - ground(points[:, 0], points[:, 1])).max() < HALF_CELL
        assert node.node.refusals.counts == {"~/tracked_odometry: frame": 1}, "before there was a transform"


LIMIT = '<limit lower="{}" upper="{}" effort="50" velocity="50"/>'
PARTS = [
    link("base", '<box size="0.6 0.6 0.2"/>', moment=0.1),
    link("arm", "", moment=0.1),
    link("reel", "", moment=0.1),
    joint("shoulder", "revolute", "base", "arm", LIMIT.format("-2", "2"), "0 0 0", "0 0 1"),
    joint("wheel", "continuous", "base", "reel", LIMIT.format("0", "0"), "0 0 0", "0 0 1"),
]


def command_of(block: str, **values: float) -> tuple[str, JointState]:
    """What a block of topic_based_ros2_control sends, and on which topic: arrays have the numbers of those of its
    joints alone that have the interface, NaN where no controller has set one (``values``: by joint)."""
    system = ElementTree.fromstring(block)
    [topic] = [item.text for item in system.iterfind("hardware/param") if item.get("name") == "joint_commands_topic"]
    assert topic is not None
    message = JointState(name=[str(joint.get("name")) for joint in system.iterfind("joint")])
    for name, found in zip(message.name, system.iterfind("joint"), strict=True):
        for interface in found.iterfind("command_interface"):
            getattr(message, str(interface.get("name"))).append(values.get(name, math.nan))
    return topic, message


def test_two_blocks_drive_a_robot_on_the_topics_of_the_page() -> None:
    [arm] = [block for block in blocks("docs/robots.md", "xml") if "TopicBasedSystem" in block]
    [command] = [block for block in blocks("docs/robots.md", "console") if "topic_based" in block]
    wheels = arm.replace("shoulder", "wheel").replace(
        'command_interface name="position"', 'command_interface name="velocity"'
    )
    start = "robot.start:=['{id: robot, xy: [5.0, 5.0], above: 0.11}']"
    with fed({}, [*arguments_of(command), "-p", start]) as node:
        node.give("heightmap", stamped(node, heightmap_message(np.zeros((21, 21)), resolution=0.5)))
        node.give("/robot_description", String(data=robot(*PARTS, arm, wheels)))
        wait_until(lambda: node.node.turn() or "robot" in node.world.bodies)
        assert "/topic_based_joint_states" in {found.topic_name for found in node.node.publishers}
        for shoulder, wheel in ((math.nan, math.nan), (0.7, math.nan), (0.7, 3.0)):
            for _ in range(10):
                node.give(*command_of(arm, shoulder=shoulder), steps=0)
                node.give(*command_of(wheels, wheel=wheel), steps=24)
            turned, driven = node.world.joints("robot")
            found, wanted = (turned.position, driven.velocity), np.nan_to_num((shoulder, wheel))
            assert found == pytest.approx(wanted, abs=0.02)
        topic, message = command_of(re.sub(r"</ros2_control>$", "", arm.strip()) + wheels[wheels.index("<joint") :])
        node.give(topic, message)
        assert node.node.refusals.counts == {"joint_commands: length": 1}
