"""Description of the machine of a benchmark: cores, CPU model, load and versions, but nothing that identifies it."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

PACKAGES = ("numpy", "pybullet", "mujoco", "sapien", "rapier3d", "coal")


def describe() -> dict[str, object]:
    """Return cores, CPU model, load average over five minutes, and versions of Python and the measured packages."""
    load = round(os.getloadavg()[1], 1)
    return {"cores": os.cpu_count() or 1, "cpu": _cpu_model(), "load": load, "versions": _versions()}


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def _versions() -> dict[str, str]:
    found = {one.name: one.version for one in distributions()}
    return {"python": platform.python_version(), **{name: found.get(name, "not installed") for name in PACKAGES}}


def short() -> str:
    """The machine, by cores and processor."""
    found = describe()
    return f"{found['cores']} cores, {found['cpu']}"


def measured_on(found: Mapping[str, Any]) -> str:
    """What `describe` found, with versions, as the beginning of a sentence."""
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return f"Measured on {found['cores']} cores of {found['cpu']}; {versions}"
