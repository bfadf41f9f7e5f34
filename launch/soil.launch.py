"""Starts the collider and the soil that gives way under its bodies, and with rover:=true a robot that leaves ruts."""

from typing import Any

from launch import LaunchDescription
from smartmesh_ros.startup.launching import Values, argument, description, is_true, node, time_of


def soil(value: Values) -> list[Any]:
    """Return the node soil, and the rover if it is asked for."""
    common = {"output": "screen", "namespace": value("namespace")}
    nodes = [node(executable="soil", parameters=[{"soil": value("soil")} | time_of(value)], **common)]
    if is_true(value("rover")):
        nodes.append(node(executable="rover", parameters=[time_of(value)], **common))
    return nodes


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    name = argument("soil", "dry_sand", "Name of the soil, see docs/soil.md.")
    words = "true = a robot drives an eight on an elevation model; false = publish your own terrain and spawn bodies."
    rover = argument("rover", "false", words)
    return description(name, rover, always="soil", start=soil)
