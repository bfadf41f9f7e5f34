"""Command lines: the options ``--help`` and ``--print-parameters``; parameter files."""

from __future__ import annotations

import json
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from rclpy.utilities import remove_ros_args

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.declaring import Spec, refused_arguments
from smartmesh_ros.startup.arguments import plain, refuse_expanded
from smartmesh_ros.yaml_text import parsed_yaml


def own_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the arguments of a command line that are not of ROS, without the name of the executable. Exits with 2 if
    those of ROS are invalid."""
    try:
        refuse_expanded(arguments)
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
# Options that ROS takes behind --ros-args alone.
OF_ROS = ("-p", "--param", "--params-file", "-r", "--remap", "--log-level")


def answer(name: str, about: str | None, specs: Sequence[Spec], args: Sequence[str] | None = None) -> None:
    """Prints the help or the parameter file if the command line asks for it, and exits; returns otherwise.

    Exits with 2 at an unknown argument, because the node would start with settings other than those intended.
    """
    for argument in own_arguments(sys.argv if args is None else [name, *args]):
        if argument in ("-h", "--help"):
            print(help_text(name, about, specs))
        elif argument == "--print-parameters":
            print(parameter_file(name, specs))
        else:
            hint = "put --ros-args before it" if argument in OF_ROS else "try --help"
            print(f"{name}: unknown argument {argument!r}; {hint}", file=sys.stderr)
            sys.exit(2)
        sys.exit(0)


def help_text(name: str, about: str | None, specs: Sequence[Spec]) -> str:
    """Return the help of an executable: its purpose, options and parameters."""
    lines = [f"usage: ros2 run smartmesh_ros {name} [options] [--ros-args ...]", "", plain(about)]
    lines += ["", "options:", *(f"  {option:22}{text}" for option, text in OPTIONS.items())]
    lines += ["", "parameters:"] if specs else []
    for spec in specs:
        lines.append(f"  {spec.name} = {typed(spec.default)}{_limits(spec)}")
        lines += textwrap.wrap(spec.description, WIDTH, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines)


def parameter_file(name: str, specs: Sequence[Spec]) -> str:
    """Return a file for ``--params-file`` that sets every parameter to its default; comments give the descriptions."""
    start = "  ros__parameters:" if specs else "  ros__parameters: {}"  # rcl cannot read a mapping without entries
    lines = [f"# Every parameter of {name}, at its default.", "/**:", start]
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


PARAMETERS = "ros__parameters"


def files_of(arguments: Sequence[str]) -> list[Path]:
    """Return the parameter files that a command line names, in order."""
    return [Path(value) for option, value in pairwise(arguments) if option == "--params-file"]


def set_one_by_one(arguments: Sequence[str]) -> list[str]:
    """Return the names of the parameters that a command line sets by ``-p``, in order."""
    return [value.partition(":=")[0] for option, value in pairwise(arguments) if option in ("-p", "--param")]


def source_of(file: Path) -> str:
    """Return what a user knows a parameter file as: launch_ros writes the values in launch files into files of its own,
    with random names."""
    return "values in a launch file" if file.name.startswith("launch_params_") else str(file)


def mismatch(file: Path, node: str) -> str | None:
    """Return a warning if a parameter file names only nodes other than ``node`` (fully qualified), else None.

    rcl ignores such a file silently. Unreadable files give None, because rcl reports them itself.
    """
    try:
        content = parsed_yaml(file.read_text())
    except (OSError, ValueError):  # `InputError` is one
        return None
    names = [name for name, _ in parameters_by_node(content)]
    if not names or any(re.fullmatch(pattern(name), node) for name in names):
        return None
    return f"parameter file {file} has no effect: it is for {', '.join(names)}, and this node is {node}"


def parameters_by_node(content: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the fully qualified names of the nodes that a file has parameters for, as of `pattern`, and these by name;
    namespaces and groups may be nested."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == PARAMETERS:
            yield path, dict(flat(value))
        else:
            yield from parameters_by_node(value, f"{path}/{str(key).strip('/')}")


def flat(content: Any, group: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the full names and values of what may be in nested groups; ``group``: beginning of the names."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if isinstance(value, dict):
            yield from flat(value, f"{group}{key}.")
        else:
            yield f"{group}{key}", value


def pattern(name: str) -> str:
    """Return a regular expression for a node name: ``*`` matches one part of the name, ``**`` any number."""
    parts = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    return "".join(parts.get(part, "/" + re.escape(part)) for part in name.split("/")[1:])
