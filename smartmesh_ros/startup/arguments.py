"""Numbers on command lines."""

from __future__ import annotations

import re
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable
from contextlib import suppress
from typing import Any


class Parser(ArgumentParser):
    """A parser that takes -3e-16 for a number. Python's takes it for an option."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = re.compile(r"-(\d+\.?|\d*\.\d+)([eE][-+]?\d+)?$")


def number(kind: type[int] | type[float], low: float, high: float) -> Callable[[str], float]:
    """Return what argparse takes as the ``type`` of a number from ``low`` to ``high``."""

    def converted(text: str) -> float:
        with suppress(ValueError):
            if low <= (value := kind(text)) <= high:
                return value
        raise ArgumentTypeError(f"{text!r} is no {'whole ' * (kind is int)}number from {low:g} to {high:g}")

    return converted
