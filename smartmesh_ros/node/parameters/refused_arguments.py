"""What rclpy does not accept of a command line or of a parameter file, as `InputError`."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.utilities import remove_ros_args

from smartmesh_ros.errors import InputError

# Part of rcl's message -> what would be right; the first that occurs counts.
_HINTS = {
    "Sequence should be of same type": (
        "every entry of a list must be of the same type, so write [0.0, 0.0, -9.81] and not [0, 0, -9.81]"
    ),
    "parameter override rule": (
        "write -p name:=value, where the value is a number, a text, true, false, or a list of one of these"
    ),
    "params": "--params-file needs the path of a YAML file: node name, then ros__parameters, then name: value",
    "": "try --help",
}


@contextmanager
def refused_arguments() -> Iterator[None]:
    """Raise `InputError` in place of rclpy's errors about arguments of ROS and about types of its own parameters."""
    try:
        yield
    except rclpy_implementation.UnknownROSArgsError as error:
        raise InputError("arguments", f"unknown arguments of ROS: {error}; try --help") from None
    except rclpy_implementation.RCLInvalidROSArgsError as error:
        # Without the places in rcl's sources.
        text = re.sub(r"^Failed to parse ROS arguments: |(\. Error: error not set)?(, at \S+:\d+)+", "", str(error))
        raise InputError("arguments", f"{text}; {next(_HINTS[words] for words in _HINTS if words in text)}") from None
    except ParameterException as error:
        raise InputError("parameter", str(error)) from None


def own_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the arguments of a command line that are not of ROS, without the name of the executable. Exits with 2 if
    those of ROS are invalid."""
    try:
        with refused_arguments():
            return list(remove_ros_args(list(arguments))[1:])
    except InputError as error:
        print(f"cannot start: {error}", file=sys.stderr)
        sys.exit(2)
