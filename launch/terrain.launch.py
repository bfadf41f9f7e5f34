"""Starts the collider and a terrain to try it with."""

from typing import Any

from launch.actions import DeclareLaunchArgument
from launch_ros.actions import Node

from launch import LaunchDescription
from smartmesh_ros.launching import Values, description, is_true


def source(value: Values) -> list[Any]:
    """The source of terrain."""
    parameters = {"scene": value("scene"), "use_sim_time": is_true(value("use_sim_time"))}
    node = {"package": "smartmesh_ros", "executable": "terrain_source", "output": "screen"}
    return [Node(**node, namespace=value("namespace"), parameters=[parameters])]


def generate_launch_description() -> LaunchDescription:
    """The launch description."""
    scene = DeclareLaunchArgument(
        "scene", default_value="waves", description="Scene of terrain_source: waves, rut, crater, heave or elevation."
    )
    return description(scene, start=source)
