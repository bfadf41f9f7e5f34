"""Numbers on command lines."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable
from contextlib import suppress


def number(kind: type[int] | type[float], low: float, high: float) -> Callable[[str], float]:
    """Return what argparse takes as the ``type`` of a number from ``low`` to ``high``."""

    def converted(text: str) -> float:
        with suppress(ValueError):
            if low <= (value := kind(text)) <= high:
                return value
        raise ArgumentTypeError(f"{text!r} is no {'whole ' * (kind is int)}number from {low:g} to {high:g}")

    return converted
