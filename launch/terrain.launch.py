"""Starts the collider with a few bodies and a robot, and a terrain source, for trying them."""

from typing import Any

from launch import LaunchDescription
from smartmesh_ros.startup.launching import Values, description, own_node, scene_argument

# Low and long waves, on which a robot with free wheels stays for minutes.
WAVES = {"wave.amplitude": 0.1, "wave.number": 0.5, "wave.frequency": 2.0}


def source(value: Values) -> list[Any]:
    """Return the node terrain_source."""
    return [own_node(value, "terrain_source", {"scene": value("scene")} | WAVES)]


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    return description(scene_argument(), always="bodies", settings=lambda _: {"publish.tf": 50.0}, start=source)
