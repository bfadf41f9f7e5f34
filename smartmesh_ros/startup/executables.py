"""Entry points of the executables. PyBullet is silenced before its import, because the import prints."""

from __future__ import annotations

import importlib
import os
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

from smartmesh_ros.startup.quiet import ending_with_reader, import_pybullet_quietly, silence_pybullet

# Arguments that make a node print something and exit without starting.
QUESTIONS = {"-h", "--help", "--print-parameters"}


def terrain_collider() -> None:
    """Run the node terrain_collider."""
    _exit_on_signals()
    silence_pybullet()
    _start("smartmesh_ros.node.terrain_collider")


def terrain_source() -> None:
    """Run the node that publishes demo terrain."""
    _exit_on_signals()
    _start("smartmesh_ros.tools.demo.terrain_source")


def terrain_sensor() -> None:
    """Run a lidar or a depth camera."""
    _exit_on_signals()
    silence_pybullet()
    _start("smartmesh_ros.node.sensor.terrain_sensor")


def soil() -> None:
    """Run the soil."""
    _exit_on_signals()
    silence_pybullet()
    _start("smartmesh_ros.node.soil.soil_node")


def rover() -> None:
    """Run the robot of the soil's demo."""
    _exit_on_signals()
    import_pybullet_quietly()
    _start("smartmesh_ros.tools.demo.rover")


def fleet_front() -> None:
    """Run the front of a fleet."""
    _exit_on_signals()
    silence_pybullet()
    _start("smartmesh_ros.node.fleet.front")


def fleet() -> None:
    """Run several nodes and their front."""
    _exit_on_signals()
    _start("smartmesh_ros.node.fleet.command")


def demo() -> None:
    """Run the demo."""
    _exit_on_signals()
    import_pybullet_quietly()
    _start("smartmesh_ros.tools.demo.demo")


def view() -> None:
    """Run the page in the browser."""
    _exit_on_signals()
    import_pybullet_quietly()
    _start("smartmesh_ros.tools.view.main")


def tune() -> None:
    """Search for parameters. Needs no ROS. PyBullet is silenced before measuring imports it."""
    silence_pybullet()
    main = importlib.import_module("smartmesh_ros.tools.tune.cli").main
    with ending_with_reader():
        sys.exit(main())


def _exit_on_signals() -> None:
    """Exit at once on SIGINT or SIGTERM, until the executable installs its own handlers.

    Call this before the imports, which take a second and leave nothing to clean up. Without these handlers, SIGINT
    would be lost in a background job, because shells start background jobs with SIGINT ignored.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))


def _start(module: str) -> None:
    try:
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        if find_spec("rclpy") and find_spec("smartmesh_msgs"):
            raise
        sys.exit(f"{Path(sys.argv[0]).name} needs ROS 2 and smartmesh_msgs ({error}); source your workspace")
    with ending_with_reader():
        main()
