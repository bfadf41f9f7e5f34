"""Log lines about the node itself: one at the start, and one for each changed parameter."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

from rclpy.node import Node

from smartmesh_ros.node.parameters.parameter_files import files_of, mismatch
from smartmesh_ros.node.parameters.settings import Settings


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
