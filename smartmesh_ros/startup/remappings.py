"""Remapping rules of command lines."""

from __future__ import annotations

import os
from collections.abc import Iterable

from smartmesh_ros.errors import InputError


def refuse_expanded(words: Iterable[str]) -> None:
    """Raise `InputError` if a shell made a path of a private name: ``-r ~/heightmap:=/maps`` without quotes, which
    would remap nothing."""
    home = os.environ.get("HOME", "").rstrip("/")
    for word in words if home else ():
        if ":=" in word and word.startswith(f"{home}/"):
            meant = f"~{word.removeprefix(home)}"
            raise InputError("arguments", f"the shell made {word} of {meant}; put the remapping into quotes: '{meant}'")
