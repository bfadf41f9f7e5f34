"""Parameter files of the command line, and a check that they apply to this node."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

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
