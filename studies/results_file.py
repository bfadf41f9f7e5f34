"""Results of studies as JSON with one record a line, so that files stay short and their diffs can be read."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

# Significant digits of a figure: more than any table shows.
DIGITS = 5


def read_results(path: Path) -> dict[str, Any]:
    """What was written there before, empty if there is nothing."""
    return json.loads(path.read_text()) if path.exists() else {}


def save_results(path: Path, data: dict[str, Any]) -> None:
    """Writes results; entries of the file that ``data`` does not have stay."""
    exact = json.dumps({**read_results(path), **data})
    text = json.dumps(json.loads(exact, parse_float=lambda figure: float(f"{float(figure):.{DIGITS}g}")), indent=1)
    # Strings hold no line breaks, so that this changes the layout alone: what has no braces inside takes a line.
    path.write_text(re.sub(r"{[^{}]+}|\[[^][{}]+\]", _in_a_line, text) + "\n")


def _in_a_line(record: re.Match[str]) -> str:
    return re.sub(r",\n *", ", ", re.sub(r"(?<=[{[])\n *|\n *(?=[]}])", "", record[0]))
