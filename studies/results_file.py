"""Results of studies as JSON with one record a line, so that files stay short and their diffs can be read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

# Significant digits of a figure: more than any table shows.
DIGITS = 5


def read_results(path: Path) -> dict[str, Any]:
    """What was written there before, empty if there is nothing."""
    return json.loads(path.read_text()) if path.exists() else {}


def save_results(path: Path, data: dict[str, Any]) -> None:
    """Writes results; entries of the file that ``data`` does not have stay."""
    path.write_text(f"{_text({**read_results(path), **data}, 0)}\n")


def records(results: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Results, which are dataclasses, by scene or group and name, as records."""
    return {group: {name: asdict(one) for name, one in found.items()} for group, found in results.items()}


def _text(value: Any, depth: int) -> str:
    """A value as JSON: a record without records of its own takes a line."""
    inner = " " * (depth + 1)
    if isinstance(value, dict) and any(isinstance(item, dict) or _is_records(item) for item in value.values()):
        lines = [f"{inner}{json.dumps(key)}: {_text(item, depth + 1)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + "\n" + " " * depth + "}"
    if _is_records(value):
        return "[\n" + ",\n".join(inner + _text(item, depth + 1) for item in value) + "\n" + " " * depth + "]"
    return json.dumps(_rounded(value))


def _is_records(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(item, dict) for item in value)


def _rounded(value: Any) -> Any:
    """A value with its numbers rounded."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{DIGITS}g}")
    return value
