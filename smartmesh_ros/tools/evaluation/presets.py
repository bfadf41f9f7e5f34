"""The presets of the package, as configurations of patches and physics."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import yaml

import smartmesh_ros
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig

NAMES = ("accurate", "fast", "fleet", "quadruped", "rover")


class Preset(NamedTuple):
    """Name of a preset, and its configurations of patches and physics."""

    name: str
    patch: PatchConfig
    physics: PhysicsConfig


def folder() -> Path | None:
    """Return the folder of the presets in the source tree or in the installed share folder, None if not found."""
    package = Path(smartmesh_ros.__file__).parent
    for above in package.parents:
        for candidate in (above / "share" / "smartmesh_ros" / "config", above / "config"):
            if (candidate / "fast.yaml").is_file():
                return candidate
    return None


def read_presets() -> list[Preset]:
    """Return all presets; an empty list if they are not installed."""
    found = folder()
    return [_read(found / f"{name}.yaml") for name in NAMES] if found else []


def _read(path: Path) -> Preset:
    nodes: dict[str, Any] = yaml.safe_load(path.read_text())
    values = next(iter(nodes.values()))["ros__parameters"]

    def given(group: str, config: type) -> dict[str, Any]:
        names = {field.name: f"{group}.{field.name}" for field in fields(config)}
        return {name: values[parameter] for name, parameter in names.items() if parameter in values}

    patch, physics = given("patch", PatchConfig), given("physics", PhysicsConfig)
    return Preset(path.stem, PatchConfig(**patch), PhysicsConfig(**physics))
