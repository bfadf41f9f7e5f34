"""The presets of the package, as configurations of patches and physics."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.tools.tune.start import PRESETS, preset_folder


class Preset(NamedTuple):
    """Name of a preset, and its configurations of patches and physics."""

    name: str
    patch: PatchConfig
    physics: PhysicsConfig


def read_presets() -> list[Preset]:
    """Return all presets; an empty list if they are not installed."""
    found = preset_folder()
    return [_read(found / f"{name}.yaml") for name in PRESETS] if found else []


def _read(path: Path) -> Preset:
    nodes: dict[str, Any] = yaml.safe_load(path.read_text())
    values = next(iter(nodes.values()))["ros__parameters"]

    def given(group: str, config: type) -> dict[str, Any]:
        names = {field.name: f"{group}.{field.name}" for field in fields(config)}
        return {name: values[parameter] for name, parameter in names.items() if parameter in values}

    patch, physics = given("patch", PatchConfig), given("physics", PhysicsConfig)
    return Preset(path.stem, PatchConfig(**patch), PhysicsConfig(**physics))
