"""What studies do beside measuring: they tell how far they are, and describe the machine."""

from __future__ import annotations

import os
import platform
import re
import sys
from importlib.metadata import distributions
from pathlib import Path
from time import perf_counter

PACKAGES = ("numpy", "pybullet", "mujoco", "sapien", "rapier3d", "coal")
BEGUN = perf_counter()


def say(line: str) -> None:
    """Show a line in place of the one before on the standard error output, behind the time since the start."""
    print(f"\r\033[K{perf_counter() - BEGUN:5.0f} s  {line}", end="", file=sys.stderr, flush=True)


def short(between: str = ", ") -> str:
    """The machine, by cores and processor, and nothing that identifies it."""
    file = Path("/proc/cpuinfo")
    models = re.findall(r"model name\s*: (.*)", file.read_text()) if file.exists() else []
    return f"{os.cpu_count() or 1} cores{between}{(models or [platform.processor() or platform.machine()])[0]}"


def measured_on() -> str:
    """The machine, and versions of Python and the measured packages, as the beginning of a sentence."""
    found = {one.name: one.version for one in distributions()}
    versions = ", ".join(f"{name} {found.get(name, 'not installed')}" for name in PACKAGES)
    return f"Measured on {short(' of ')}; python {platform.python_version()}, {versions}"
