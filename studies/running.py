"""What studies do beside measuring: they tell how far they are, describe the machine, and keep results as JSON."""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Mapping
from importlib.metadata import distributions
from pathlib import Path
from time import perf_counter
from typing import Any

PACKAGES = ("numpy", "pybullet", "mujoco", "sapien", "rapier3d", "coal")
# Significant digits of a figure in JSON: more than any table shows.
DIGITS = 5
BEGUN = perf_counter()


def say(line: str) -> None:
    """Show a line in place of the one before on the standard error output, behind the time since the start."""
    print(f"\r\033[K{perf_counter() - BEGUN:5.0f} s  {line}", end="", file=sys.stderr, flush=True)


def describe() -> dict[str, Any]:
    """Return cores, CPU model, load average over five minutes, and versions of Python and the measured packages, but
    nothing that identifies the machine."""
    file, found = Path("/proc/cpuinfo"), {one.name: one.version for one in distributions()}
    models = re.findall(r"model name\s*: (.*)", file.read_text()) if file.exists() else []
    versions = {name: found.get(name, "not installed") for name in PACKAGES}
    return {
        "cores": os.cpu_count() or 1, "cpu": (models or [platform.processor() or platform.machine()])[0],
        "load": round(os.getloadavg()[1], 1), "versions": {"python": platform.python_version(), **versions},
    }  # fmt: skip


def short() -> str:
    """The machine, by cores and processor."""
    found = describe()
    return f"{found['cores']} cores, {found['cpu']}"


def measured_on(found: Mapping[str, Any]) -> str:
    """What `describe` found, with versions, as the beginning of a sentence."""
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return f"Measured on {found['cores']} cores of {found['cpu']}; {versions}"


def read_results(path: Path) -> dict[str, Any]:
    """What was written there before, empty if there is nothing."""
    return json.loads(path.read_text()) if path.exists() else {}


def save_results(path: Path, data: dict[str, Any]) -> None:
    """Writes results with one record a line, so that files stay short and their diffs can be read; entries of the file
    that ``data`` does not have stay."""
    exact = json.dumps({**read_results(path), **data})
    text = json.dumps(json.loads(exact, parse_float=lambda figure: float(f"{float(figure):.{DIGITS}g}")), indent=1)

    def in_a_line(record: re.Match[str]) -> str:
        return re.sub(r",\n *", ", ", re.sub(r"(?<=[{[])\n *|\n *(?=[]}])", "", record[0]))

    # Strings hold no line breaks, so that this changes the layout alone: what has no braces inside takes a line.
    path.write_text(re.sub(r"{[^{}]+}|\[[^][{}]+\]", in_a_line, text) + "\n")
