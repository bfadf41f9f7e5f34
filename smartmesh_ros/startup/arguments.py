"""Numbers, folders and remapping rules on command lines."""

from __future__ import annotations

import os
import re
from argparse import ArgumentParser, ArgumentTypeError, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from smartmesh_ros.errors import InputError


class Parser(ArgumentParser):
    """A parser that keeps the lines of its description, a docstring, and takes -3e-16 for a number; Python's takes it
    for an option."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **{"formatter_class": RawDescriptionHelpFormatter, **options})
        self.description = plain(self.description)
        self._negative_number_matcher = re.compile(r"-(\d+\.?|\d*\.\d+)([eE][-+]?\d+)?$")


def plain(docstring: str | None) -> str:
    """Return a docstring as it is printed, without the marks of its code."""
    return (docstring or "").replace("``", "").strip()


def number(kind: type[int] | type[float], low: float, high: float) -> Callable[[str], float]:
    """Return what argparse takes as the ``type`` of a number from ``low`` to ``high``."""

    def converted(text: str) -> float:
        with suppress(ValueError):
            if low <= (value := kind(text)) <= high:
                return value
        raise ArgumentTypeError(f"{text!r} is no {'whole ' * (kind is int)}number from {low:g} to {high:g}")

    return converted


def make_folder(path: Path) -> None:
    """Make the folder of ``--out`` unless it is there, before the work whose results it gets. Raises `InputError` if no
    file can be written there."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=path).close()
    except OSError as error:
        raise InputError("file", f"nothing can be written in {path}: {error}; name another folder by --out") from None


def refuse_expanded(words: Iterable[str]) -> None:
    """Raise `InputError` if a shell made a path of a private name: ``-r ~/heightmap:=/maps`` without quotes, which
    would remap nothing."""
    home = os.environ.get("HOME", "").rstrip("/")
    for word in words if home else ():
        if ":=" in word and word.startswith(f"{home}/"):
            meant = f"~{word.removeprefix(home)}"
            raise InputError("arguments", f"the shell made {word} of {meant}; put the remapping into quotes: '{meant}'")
