"""Command lines: the options ``--help`` and ``--print-parameters``, and what rclpy does not accept, as `InputError`."""

from __future__ import annotations

import json
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.exceptions import ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.utilities import remove_ros_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.declaring import Spec

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


WIDTH = 100
OPTIONS = {
    "-h, --help": "print this and end",
    "--print-parameters": "print a parameter file with every default, and end",
    "--ros-args ...": "arguments of ROS: -p name:=value, --params-file FILE, -r from:=to, -r __ns:=/robot",
}


def answer(name: str, about: str | None, specs: Sequence[Spec], args: list[str] | None = None) -> None:
    """Prints the help or the parameter file if the command line asks for it, and exits; returns otherwise.

    Exits with 2 at an unknown argument, because the node would start with settings other than those intended.
    """
    for argument in own_arguments(sys.argv if args is None else [name, *args]):
        if argument in ("-h", "--help"):
            print(help_text(name, about, specs))
        elif argument == "--print-parameters":
            print(parameter_file(name, specs))
        else:
            print(f"{name}: unknown argument {argument!r}; try --help", file=sys.stderr)
            sys.exit(2)
        sys.exit(0)


def help_text(name: str, about: str | None, specs: Sequence[Spec]) -> str:
    """Return the help of an executable: its purpose, options and parameters."""
    lines = [f"usage: ros2 run smartmesh_ros {name} [options] [--ros-args ...]", "", (about or "").strip()]
    lines += ["", "options:", *(f"  {option:22}{text}" for option, text in OPTIONS.items()), "", "parameters:"]
    for spec in specs:
        lines.append(f"  {spec.name} = {typed(spec.default)}{_limits(spec)}")
        lines += textwrap.wrap(spec.description, WIDTH, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines)


def parameter_file(name: str, specs: Sequence[Spec]) -> str:
    """Return a file for ``--params-file`` that sets every parameter to its default; comments give the descriptions."""
    lines = [f"# Every parameter of {name}, at its default.", "/**:", "  ros__parameters:"]
    for spec in specs:
        comment = spec.description + _limits(spec)
        lines += textwrap.wrap(comment, WIDTH, initial_indent="    # ", subsequent_indent="    # ")
        # rcl cannot read an empty list, so parameters whose default is one are commented out.
        lines.append(f"    {'# ' if spec.default == [] else ''}{spec.name}: {typed(spec.default)}")
    return "\n".join(lines)


def typed(value: Any) -> str:
    """Return a value as it is typed in a file or after ``-p``."""
    text = json.dumps(value)
    # YAML reads 1e-07 as a string, 1.0e-07 as a number.
    return text.replace("e", ".0e") if isinstance(value, float) and "e" in text and "." not in text else text


def _limits(spec: Spec) -> str:
    parts = [part for part in (spec.values, "fixed after the start" if spec.read_only else "") if part]
    return f"  [{'; '.join(parts)}]" if parts else ""
