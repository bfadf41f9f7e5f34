"""The executable ``terrain_collider``: quiet first, because importing the node imports PyBullet."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from smartmesh_ros.node.quiet import silence_pybullet


def terrain_collider() -> None:
    """Runs the node until SIGINT or SIGTERM."""
    silence_pybullet()
    try:
        from smartmesh_ros.node.terrain_collider import main
    except ModuleNotFoundError as error:
        if find_spec("rclpy") and find_spec("smartmesh_msgs"):
            raise
        sys.exit(f"terrain_collider needs ROS 2 and smartmesh_msgs ({error}); source your workspace")
    main()
