"""Starts a collider whose ground gives way under its bodies, and with rover:=true a robot that leaves ruts."""

from typing import Any

from launch import LaunchDescription
from smartmesh_ros.startup.launching import Values, argument, description, is_true, own_node


def soil(value: Values) -> dict[str, Any]:
    """Return the parameters of the soil. The rover turns by the slip of its wheels, which would dig in."""
    names = [name.strip() for name in value("soil").split(",")]
    return {"soil.type": names, "soil.slip_sinkage": not is_true(value, "rover")}


def rover(value: Values) -> list[Any]:
    """Return the rover if it is asked for."""
    return [own_node(value, "rover")] if is_true(value, "rover") else []


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    name = argument("soil", "dry_sand", "Name of the soil, or several with commas, see docs/soil.md.")
    words = "true = a robot drives an eight on an elevation model; false = publish your own terrain and spawn bodies."
    return description(name, argument("rover", "false", words), settings=soil, start=rover)
