"""The parameters that a search starts from: a file, a preset and single values, checked by the node's own code."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

import smartmesh_ros
from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters.declaring import nearest
from smartmesh_ros.node.parameters.helping import PARAMETERS, mismatch
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.parameters.specifications import NAMES, SPECS, settings_from

PRESETS = ("accurate", "fast", "fleet", "quadruped", "rover")
NODE = "/terrain_collider"
DEFAULTS: Mapping[str, Any] = {spec.name: spec.default for spec in SPECS}


def settings_of(values: Mapping[str, Any]) -> Settings:
    """Return settings with these parameters, and all others at their defaults; raise `InputError` if one is invalid."""
    return settings_from({**DEFAULTS, **{name: value for name, value in values.items() if name in NAMES}})


def read_start(file: Path | None, preset: str, single: Sequence[str]) -> dict[str, Any]:
    """Return the parameters of a preset, a file and entries ``name=value``; later ones override earlier ones. Raise
    `InputError` for unknown names and invalid values."""
    values = preset_values(preset) if preset else {}
    if file is not None:
        values.update(_read(file))
    for entry in single:
        name, equals, text = entry.partition("=")
        if not equals:
            raise InputError("parameter", f"--set {entry!r} must be name=value, as in --set physics.rate=120.0")
        values[name] = yaml.safe_load(text)
    for name in values:
        if name not in NAMES | {"use_sim_time"}:  # the latter is one of every ROS node
            raise InputError("parameter", f"parameter {name!r} is unknown{nearest(name, SPECS)}")
    settings_of(values)
    return values


def preset_folder() -> Path | None:
    """Return the folder of the presets in the source tree or in the installed share folder, None if not found."""
    for above in Path(smartmesh_ros.__file__).parents[1:]:
        for candidate in (above / "share" / "smartmesh_ros" / "config", above / "config"):
            if (candidate / "fast.yaml").is_file():
                return candidate
    return None


def preset_values(name: str) -> dict[str, Any]:
    """Return the parameters of a preset; raise `InputError` with the known presets if it does not exist."""
    found = preset_folder()
    path = (found or Path()) / f"{name}.yaml"
    if found is None or not path.is_file():
        known = sorted(file.stem for file in found.glob("*.yaml")) if found else []
        raise InputError("preset", f"there is no preset {name!r}; choose {', '.join(known) or 'a parameter file'}")
    return _read(path)


def _read(path: Path) -> dict[str, Any]:
    """Return a parameter file's values for the node; raise `InputError` if the file is invalid or for another node."""
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise InputError("file", f"{path} is no parameter file: {error}") from None
    wrong = mismatch(path, NODE)
    if wrong:
        raise InputError("file", wrong)
    found = dict(_entries(content))
    if not found:
        raise InputError("file", f"{path} has no {PARAMETERS}; it must read '/**: {{{PARAMETERS}: {{name: value}}}}'")
    return found


def _entries(content: Any, group: str | None = None) -> Iterator[tuple[str, Any]]:
    """Yield names and values of parameters; ``group``: their common prefix, None = outside of ``ros__parameters``."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if group is None:
            yield from _entries(value, "" if key == PARAMETERS else None)
        elif isinstance(value, dict):
            yield from _entries(value, f"{group}{key}.")
        else:
            yield f"{group}{key}", value
