"""Starts the collider alone."""

from smartmesh_ros.startup.launching import description as generate_launch_description

__all__ = ["generate_launch_description"]
