"""Markdown tables and the numbers in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

# Above one: today is faster.
RATIO = "report / today"


def beside(reported: float, today: float) -> list[str]:
    """The report's figure, today's, and how many times faster today's is."""
    return [number(reported), number(today), times(reported / today)]


def size(side: int) -> str:
    """``side`` x ``side``."""
    return f"{side}x{side}"


def number(value: float) -> str:
    """Three significant digits, without an exponent; - where there is none."""
    if math.isnan(value):
        return "-"
    if value == 0.0:
        return "0"
    return f"{value:.{max(2 - math.floor(math.log10(abs(value))), 0)}f}"


def times(ratio: float) -> str:
    """A ratio, as 3.2x."""
    return "-" if math.isnan(ratio) else f"{ratio:.2g}x" if ratio < 10 else f"{ratio:,.0f}x"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column is text, the others are numbers."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (header, *rows)]
    return "\n".join([lines[0], "|---|" + "---:|" * (len(header) - 1), *lines[1:]])
