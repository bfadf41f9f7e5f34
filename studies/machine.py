"""The machine of a run, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from smartmesh_ros.tools.evaluation.machine import describe


def short() -> str:
    """The machine, by cores and processor."""
    found = describe()
    return f"{found['cores']} cores, {found['cpu']}"


def measured_on(found: Mapping[str, Any]) -> str:
    """What `describe` found, with versions, as the beginning of a sentence."""
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return f"Measured on {found['cores']} cores of {found['cpu']}; {versions}"
