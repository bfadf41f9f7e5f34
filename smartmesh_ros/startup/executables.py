"""The executables that need ROS. Those that import PyBullet are quiet first: it prints when it is imported."""

from __future__ import annotations

import importlib
import sys
from importlib.util import find_spec

from smartmesh_ros import machine_code
from smartmesh_ros.startup.quiet import import_pybullet_quietly, silence_pybullet

# Arguments that a node answers without starting.
QUESTIONS = {"-h", "--help", "--print-parameters"}


def terrain_collider() -> None:
    """The node."""
    if not QUESTIONS & {*sys.argv}:
        machine_code.announce()  # before the imports below, which take a second
    silence_pybullet()
    _start("terrain_collider", "smartmesh_ros.node.terrain_collider")


def terrain_source() -> None:
    """A node that publishes terrain to try things with."""
    _start("terrain_source", "smartmesh_ros.node.demo.terrain_source")


def fleet_front() -> None:
    """The node that speaks for several."""
    silence_pybullet()
    _start("fleet_front", "smartmesh_ros.node.fleet.front")


def fleet() -> None:
    """Several nodes and their front."""
    _start("smartmesh-fleet", "smartmesh_ros.node.fleet.command")


def demo() -> None:
    """The demo."""
    import_pybullet_quietly()
    _start("smartmesh-demo", "smartmesh_ros.node.demo.demo")


def view() -> None:
    """The page in the browser."""
    import_pybullet_quietly()
    _start("smartmesh-view", "smartmesh_ros.view.main")


def _start(name: str, module: str) -> None:
    try:
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        if find_spec("rclpy") and find_spec("smartmesh_msgs"):
            raise
        sys.exit(f"{name} needs ROS 2 and smartmesh_msgs ({error}); source your workspace")
    main()
