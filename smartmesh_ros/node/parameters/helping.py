"""What an executable says of itself: ``--help`` and ``--print-parameters``."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from rclpy.utilities import remove_ros_args

from smartmesh_ros.node.parameters.declaring import Spec

WIDTH = 100
OPTIONS = {
    "-h, --help": "print this and end",
    "--print-parameters": "print a parameter file with every default, and end",
    "--ros-args ...": "arguments of ROS: -p name:=value, --params-file FILE, -r from:=to, -r __ns:=/robot",
}


def answer(name: str, about: str | None, specs: Sequence[Spec], args: list[str] | None = None) -> None:
    """Prints what is asked for in the command line and ends the process; returns where it asks for nothing.

    Ends with 2 at an argument that means nothing, rather than starting with settings other than those meant.
    """
    given = sys.argv if args is None else [name, *args]
    for argument in remove_ros_args(given)[1:]:
        if argument in ("-h", "--help"):
            print(help_text(name, about, specs))
        elif argument == "--print-parameters":
            print(parameter_file(name, specs))
        else:
            print(f"{name}: unknown argument {argument!r}; try --help", file=sys.stderr)
            sys.exit(2)
        sys.exit(0)


def help_text(name: str, about: str | None, specs: Sequence[Spec]) -> str:
    """All about an executable: what it does, its options and its parameters."""
    lines = [
        f"usage: ros2 run smartmesh_ros {name} [options] [--ros-args ...]",
        "",
        (about or "").strip(),
        "",
        "options:",
    ]
    lines += [f"  {option:22}{text}" for option, text in OPTIONS.items()]
    lines += ["", "parameters:"]
    for spec in specs:
        lines.append(f"  {spec.name} = {_text(spec.default)}{_limits(spec)}")
        lines += textwrap.wrap(spec.description, WIDTH, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines)


def parameter_file(name: str, specs: Sequence[Spec]) -> str:
    """A parameter file for ``--params-file`` that sets every parameter to its default, each with what it means."""
    lines = [f"# Every parameter of {name}, at its default.", "/**:", "  ros__parameters:"]
    for spec in specs:
        comment = spec.description + _limits(spec)
        lines += textwrap.wrap(comment, WIDTH, initial_indent="    # ", subsequent_indent="    # ")
        # rcl cannot read an empty list; such a parameter is left at its default.
        lines.append(f"    {'# ' if spec.default == [] else ''}{spec.name}: {_text(spec.default)}")
    return "\n".join(lines)


def grouped(specs: Sequence[Spec]) -> list[Spec]:
    """The parameters with those together whose names begin alike; in their order else."""
    groups = list(dict.fromkeys(_group(spec) for spec in specs))
    return sorted(specs, key=lambda spec: groups.index(_group(spec)))


def _group(spec: Spec) -> str:
    first, dot, _ = spec.name.partition(".")
    return first if dot else "others"


def parameter_page(name: str, specs: Sequence[Spec]) -> str:
    """A page of Markdown with every parameter, in tables by the first part of its name."""
    lines = [
        f"# Parameters of `{name}`",
        "",
        "Written by `scripts/write_parameters.py` from the node's declarations. Defaults stand as a parameter file or",
        "`-p` takes them. *fixed* parameters need a restart; all others change while the node runs (`ros2 param set`).",
    ]
    heading = None
    for spec in grouped(specs):
        if (group := _group(spec)) != heading:
            heading = group
            lines += ["", f"## {group}", "", "| name | default | values | change | meaning |", "|---|---|---|---|---|"]
        choices = ", ".join(f"`{choice}`" for choice in spec.choices)
        values = choices or (f"{spec.low:g} to {spec.high:g}" if spec.low is not None else "")
        change = "fixed" if spec.read_only else "any time"
        cells = (f"`{spec.name}`", f"`{_text(spec.default)}`", values, change, spec.description.replace("|", "\\|"))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _text(value: Any) -> str:
    text = json.dumps(value)
    # YAML takes 1e-07 for a string.
    return text.replace("e", ".0e") if isinstance(value, float) and "e" in text and "." not in text else text


def _limits(spec: Spec) -> str:
    parts = []
    if spec.low is not None and spec.high is not None:
        parts.append(f"{spec.low:g} to {spec.high:g}")
    if spec.choices:
        parts.append(" | ".join(spec.choices))
    if spec.read_only:
        parts.append("fixed after the start")
    return f"  [{'; '.join(parts)}]" if parts else ""
