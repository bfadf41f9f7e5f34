"""Starts the collider and a terrain source for trying it."""

from typing import Any

from launch import LaunchDescription
from smartmesh_ros.startup.launching import Values, description, node, scene_argument, time_of


def source(value: Values) -> list[Any]:
    """Return the node terrain_source."""
    parameters = {"scene": value("scene")} | time_of(value)
    return [node(executable="terrain_source", output="screen", namespace=value("namespace"), parameters=[parameters])]


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    return description(scene_argument(), start=source)
