"""Description of the machine of a benchmark: cores, CPU model, load and versions, but nothing that identifies it."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
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
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def short() -> str:
    """The machine, by cores and processor."""
    found = describe()
    return f"{found['cores']} cores, {found['cpu']}"


def measured_on(found: Mapping[str, Any]) -> str:
    """What `describe` found, with versions, as the beginning of a sentence."""
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return f"Measured on {found['cores']} cores of {found['cpu']}; {versions}"
