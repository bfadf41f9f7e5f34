"""Parameter files of the command line: which there are, and whether they are for this node at all."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

OPTION = "--params-file"
PARAMETERS = "ros__parameters"


def files_of(arguments: Sequence[str]) -> list[Path]:
    """The parameter files that a command line names, in its order."""
    return [Path(value) for option, value in pairwise(arguments) if option == OPTION]


def mismatch(file: Path, node: str) -> str | None:
    """What is wrong with a file that names other nodes than ``node`` (a whole name); None where nothing is.

    rcl passes such a file over without a word. What cannot be read is left to rcl, which says so itself.
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
    """Whole names of the nodes that a file has parameters for; namespaces may be nested."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == PARAMETERS:
            yield path
        else:
            yield from _node_names(value, f"{path}/{str(key).strip('/')}")


def _pattern(name: str) -> str:
    """A regular expression for a name: ``*`` stands for one part of it, ``**`` for any number."""
    parts = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    return "".join(parts.get(part, "/" + re.escape(part)) for part in name.split("/")[1:])
