"""Starts the collider and the soil that gives way under its bodies."""

from typing import Any

from launch.actions import DeclareLaunchArgument

from launch import LaunchDescription
from smartmesh_ros.startup.launching import Values, description, is_true, node


def soil(value: Values) -> list[Any]:
    """Return the node soil."""
    parameters = {"soil": value("soil"), "use_sim_time": is_true(value("use_sim_time"))}
    return [node(executable="soil", output="screen", namespace=value("namespace"), parameters=[parameters])]


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    name = DeclareLaunchArgument("soil", default_value="dry_sand", description="Name of the soil, see docs/soil.md.")
    return description(name, always="soil", start=soil)
