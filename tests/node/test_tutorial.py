"""The tutorials do what they say: their files and commands are taken from the pages and run."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from geometry_msgs.msg import TransformStamped
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from smartmesh_msgs.srv import QueryGround
from tf2_msgs.msg import TFMessage

from smartmesh_ros.tools.testing import Probe, Process, pose_message
from tests.grid_maps import grid_map_message

ROOT = Path(__file__).parents[2]
CELLS, RESOLUTION = 60, 0.1


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


def ground(x: Any, y: Any) -> Any:
    return 0.2 * np.sin(x) + 0.1 * np.asarray(y)


class Stack:
    """An elevation mapping stack: a robot that drives along x, and a map of 6 m that scrolls with it, cell by cell.

    The map is in ``map``, the odometry in ``odom``, which lies 10 m further along y.
    """

    def __init__(self, probe: Probe) -> None:
        self._probe = probe
        self._maps = probe.publisher(GridMap, "/elevation_mapping/elevation_map")
        self._odometry = probe.publisher(Odometry, "/odom")
        self._transforms = probe.node.create_publisher(TFMessage, "/tf", 10)
        self.x = 0.0

    def publish(self) -> None:
        stamp = self._probe.now()
        transform = TransformStamped(child_frame_id="odom")
        transform.header.stamp, transform.header.frame_id = stamp, "map"
        transform.transform.translation.y = 10.0
        self._transforms.publish(TFMessage(transforms=[transform]))
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.stamp, odometry.header.frame_id = stamp, "odom"
        odometry.pose.pose = pose_message((self.x, -10.0, float(ground(self.x, 0.0)) + 0.4))
        self._odometry.publish(odometry)
        self._maps.publish(self._map(stamp))

    def _map(self, stamp: Any) -> GridMap:
        moved = round(self.x / RESOLUTION)
        y, x = np.mgrid[:CELLS, :CELLS] * RESOLUTION - 0.5 * (CELLS - 1) * RESOLUTION
        heights = ground(x + moved * RESOLUTION, y)
        heights[:, -2:] = np.nan  # what the sensor has not seen yet
        middle, start = (moved * RESOLUTION, 0.0, 0.0), (-moved % CELLS, 0)
        return grid_map_message({"elevation": heights}, RESOLUTION, middle, start=start, stamp=stamp)


def test_an_elevation_map_becomes_patches_under_the_robot(probe: Probe, tmp_path: Path) -> None:
    [file] = blocks("docs/elevation_mapping.md", "yaml")
    command, _ = blocks("docs/elevation_mapping.md", "console")
    words = shlex.split(command.replace("\\\n", " "))
    assert words[:4] == ["ros2", "run", "smartmesh_ros", "terrain_collider"]
    assert words.count("-r") == 2
    (tmp_path / "my_robot.yaml").write_text(file)
    arguments = [word.replace("my_robot.yaml", str(tmp_path / "my_robot.yaml")) for word in words[4:]]
    with Process("terrain_collider", arguments=arguments) as process:
        stack = Stack(probe)
        for stack.x in (0.0, 0.3, 1.5):

            def patched_under_the_robot() -> bool:
                stack.publish()
                for patch in probe.latest("collider_patches").patches:
                    points = np.array([(p.x, p.y, p.z) for p in patch.mesh.vertices])
                    middle = points[:, :2].mean(axis=0)
                    if patch.body_id == "rover" and np.abs(middle - (stack.x, 0.0)).max() < 0.2:
                        return bool(np.abs(points[:, 2] - ground(points[:, 0], points[:, 1])).max() < 0.006)
                return False

            probe.wait_for(patched_under_the_robot, watch=process)
        assert probe.diagnostics("terrain")["message"] == "maps arrive"


def test_the_readmes_publisher_moves_the_ground(probe: Probe) -> None:
    _, code = blocks("README.md", "python")
    with probe.running("terrain_collider"), subprocess.Popen([sys.executable, "-c", code]) as publisher:
        try:

            def moves() -> bool:
                response = probe.call("query_ground", QueryGround, x=[0.0], y=[0.0])
                return bool(response.success) and abs(response.velocities[2]) > 0.1

            probe.wait_for(lambda: probe.diagnostics("terrain")["message"] == "maps arrive")
            probe.wait_for(moves)
            assert probe.diagnostics("inputs")["message"] == "0 refused so far"
        finally:
            publisher.kill()


def test_the_installed_file_is_that_of_the_tutorial() -> None:
    [file] = blocks("docs/elevation_mapping.md", "yaml")
    assert yaml.safe_load(file) == yaml.safe_load((ROOT / "config" / "elevation_mapping.yaml").read_text())


def test_the_tests_of_the_page_on_testing_run_in_a_package_of_ones_own(tmp_path: Path) -> None:
    conftest, *tests = blocks("docs/testing.md", "python")
    (tmp_path / "conftest.py").write_text(conftest)
    for number, text in enumerate(tests):
        (tmp_path / f"test_mine_{number}.py").write_text(text)
    command = [*f"{sys.executable} -m pytest -q -p no:cacheprovider --rootdir".split(), str(tmp_path), str(tmp_path)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
    assert f"{len(tests)} passed" in result.stdout


def test_what_the_page_on_testing_names_is_there() -> None:
    from smartmesh_ros.tools import testing

    page = (ROOT / "docs" / "testing.md").read_text()
    table = page[page.index("## What there is") : page.index("The vertices of a patch")]
    for method in re.findall(r"probe\.(\w+)", table):
        assert hasattr(testing.Probe, method) or method == "received", method
    for name in ("domain", "probe", "Process", "assert_on_map", "heightmap_message", "mesh_message", "pose_message"):
        assert hasattr(testing, name)
