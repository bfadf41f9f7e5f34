"""Rooms load without what stands to their right, and files import one way."""

import subprocess
import sys
from graphlib import TopologicalSorter

import grimp
import pytest

BLOCKED = """
import importlib, pkgutil, sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked!r}:
            raise ModuleNotFoundError(f"{{name}} is blocked in this test")

sys.meta_path.insert(0, Blocker())
import smartmesh_ros
for room in {rooms!r}:
    package = importlib.import_module(f"smartmesh_ros.{{room}}")
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"smartmesh_ros.{{room}}.{{module.name}}")
"""
ROS = ["rclpy", "rosidl_parser", "rosidl_runtime_py", "smartmesh_msgs", "std_msgs", "geometry_msgs"]
BULLET = ["pybullet", "pybullet_utils", "pybullet_data"]


@pytest.mark.parametrize(
    ("rooms", "blocked", "loads"),
    [
        (["terrain", "ground", "world", "soil", "io", "scenes"], ROS, True),
        (["terrain", "soil"], [*ROS, *BULLET], True),
        (["tools.demo", "tools.tune"], ["pytest"], True),
        (["ground"], BULLET, False),  # the blocker blocks
    ],
)
def test_rooms_load_without(rooms: list[str], blocked: list[str], loads: bool) -> None:
    script = BLOCKED.format(blocked=blocked, rooms=rooms)
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (result.returncode == 0) == loads, result.stderr
    assert loads or "pybullet is blocked" in result.stderr


@pytest.mark.parametrize("package", ["smartmesh_ros", "studies"])
def test_no_files_import_each_other_in_a_circle(package: str) -> None:
    graph = grimp.build_graph(package)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    TopologicalSorter(imports).prepare()  # raises `CycleError` with the circle
