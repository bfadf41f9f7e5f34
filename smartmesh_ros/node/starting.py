"""The executable ``terrain_collider``: quiet first, because importing the node imports PyBullet."""

from __future__ import annotations

from smartmesh_ros.node.quiet import silence_pybullet


def terrain_collider() -> None:
    """Runs the node until SIGINT or SIGTERM."""
    silence_pybullet()
    from smartmesh_ros.node.terrain_collider import main

    main()
