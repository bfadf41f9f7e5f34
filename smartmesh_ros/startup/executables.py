"""Entry points of the executables. PyBullet is silenced before its import, because the import prints."""

from __future__ import annotations

import importlib
import os
import signal
import sys
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from smartmesh_ros.startup.quiet import ending_with_reader, import_pybullet_quietly, silence_pybullet


def _exit_on_signals() -> None:
    """Exit at once on SIGINT or SIGTERM, until the executable installs its own handlers.

    Call this before the imports, which take a second and leave nothing to clean up. Without these handlers, SIGINT
    would be lost in a background job, because shells start background jobs with SIGINT ignored.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))


def _start(module: str, before: Callable[[], None] | None = silence_pybullet) -> None:
    """Run ``main`` of a module, which may import PyBullet after the call of ``before``."""
    _exit_on_signals()
    if before is not None:
        before()
    try:
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        if find_spec("rclpy") and find_spec("smartmesh_msgs"):
            raise
        sys.exit(f"{Path(sys.argv[0]).name} needs ROS 2 and smartmesh_msgs ({error}); source your workspace")
    with ending_with_reader():
        main()


terrain_collider = partial(_start, "smartmesh_ros.node.terrain_collider")
terrain_source = partial(_start, "smartmesh_ros.tools.demo.terrain_source", None)
terrain_sensor = partial(_start, "smartmesh_ros.node.sensor.terrain_sensor")
soil = partial(_start, "smartmesh_ros.node.soil.soil_node")
fleet_front = partial(_start, "smartmesh_ros.node.fleet.front")
fleet = partial(_start, "smartmesh_ros.node.fleet.command", None)
# Their standard output stays usable for child processes.
rover = partial(_start, "smartmesh_ros.tools.demo.rover", import_pybullet_quietly)
demo = partial(_start, "smartmesh_ros.tools.demo.demo", import_pybullet_quietly)
view = partial(_start, "smartmesh_ros.tools.view.main", import_pybullet_quietly)


def tune() -> None:
    """Search for parameters. Needs no ROS. PyBullet is silenced before measuring imports it."""
    silence_pybullet()
    main = importlib.import_module("smartmesh_ros.tools.tune.cli").main
    with ending_with_reader():
        sys.exit(main())
