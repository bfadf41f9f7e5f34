"""Log lines about the node's parameters and their files: at the start, and for each change."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml
from rclpy.node import Node

from smartmesh_ros.node.parameters.settings import Settings

PARAMETERS = "ros__parameters"


def files_of(arguments: Sequence[str]) -> list[Path]:
    """Return the parameter files that a command line names, in order."""
    return [Path(value) for option, value in pairwise(arguments) if option == "--params-file"]


def mismatch(file: Path, node: str) -> str | None:
    """Return a warning if a parameter file names only nodes other than ``node`` (fully qualified), else None.

    rcl ignores such a file silently. Unreadable files give None, because rcl reports them itself.
    """
    try:
        content = yaml.safe_load(file.read_text())
    except (OSError, ValueError, yaml.YAMLError):
        return None
    names = list(_node_names(content))
    if not names or any(re.fullmatch(_pattern(name), node) for name in names):
        return None
    return f"parameter file {file} has no effect: it is for {', '.join(names)}, and this node is {node}"


def _node_names(content: Any, path: str = "") -> Iterator[str]:
    """Yield the fully qualified names of the nodes that a file has parameters for; namespaces may be nested."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == PARAMETERS:
            yield path
        else:
            yield from _node_names(value, f"{path}/{str(key).strip('/')}")


def _pattern(name: str) -> str:
    """Return a regular expression for a node name: ``*`` matches one part of the name, ``**`` any number."""
    parts = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    return "".join(parts.get(part, "/" + re.escape(part)) for part in name.split("/")[1:])


def announce(node: Node, settings: Settings) -> None:
    """Logs the node's settings in one line; warns of parameter files for other nodes."""
    name = node.get_fully_qualified_name()
    files, strays = files_of(sys.argv), []
    for file in files:
        if (reason := mismatch(file, name)) is not None:
            strays.append(file)
            node.get_logger().warning(reason)
    taken = [str(file) for file in files if file not in strays]
    node.get_logger().info(f"{name}: {summary(settings)}; parameters: {', '.join(taken) or 'defaults'}")


def summary(settings: Settings) -> str:
    """Return the most important settings in one line."""
    physics, patch = settings.world.physics, settings.world.patch
    terrain = f"~/{settings.input}" + (f" and {settings.file}" if settings.file else "")
    often = f"{patch.rate:g} Hz" if patch.rate else "every step"
    return (
        f"terrain from {terrain}; physics {physics.rate:g} Hz; patches {patch.kind}, "
        f"{often}; executor {settings.executor}"
    )


def announce_changes(node: Node, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    """Logs a line for each parameter whose value changed."""
    for name, value in after.items():
        if value != before[name]:
            node.get_logger().info(f"parameter {name} is now {value!r}; it was {before[name]!r}")
