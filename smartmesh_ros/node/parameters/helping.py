"""The command-line options ``--help`` and ``--print-parameters`` of the executables."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from smartmesh_ros.node.parameters.declaring import Spec
from smartmesh_ros.node.parameters.refused_arguments import own_arguments

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
