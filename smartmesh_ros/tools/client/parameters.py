"""Values of parameters, from text."""

from __future__ import annotations

from rclpy.parameter import Parameter

from smartmesh_ros.errors import InputError
from smartmesh_ros.yaml_text import parsed_yaml


def parameter_from(name: str, text: str) -> Parameter:
    """Return a parameter with the value of a YAML text; whole numbers in a list become real ones. Raises
    `InputError`."""
    try:
        value = parsed_yaml(text)
        if isinstance(value, list):
            value = [float(item) if type(item) is int else item for item in value]
        elif type(value) is int and abs(value) >= 2**63:  # ROS has no larger whole numbers
            value = float(value)
        return Parameter(name, value=value)
    except (TypeError, ValueError, OverflowError):  # `InputError` is a ValueError
        raise InputError(
            "parameter", f"{name} cannot be {text!r}; write a number, a text, true, false, or a list of one of these"
        ) from None
