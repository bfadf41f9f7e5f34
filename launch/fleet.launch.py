"""Starts several colliders that share one terrain, the front that speaks for them, and a terrain to try them with."""

from smartmesh_ros.startup.launching import fleet as generate_launch_description

__all__ = ["generate_launch_description"]
