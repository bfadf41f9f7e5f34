"""Starts several colliders that share one terrain, their front, and a terrain source for trying them."""

from smartmesh_ros.startup.launching import fleet as generate_launch_description

__all__ = ["generate_launch_description"]
