"""Parameters of the node from files and single values, without a node."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory

from smartmesh_ros.errors import InputError, suggestion
from smartmesh_ros.node.parameters.declaring import QOS
from smartmesh_ros.node.parameters.helping import PARAMETERS, mismatch, parameters_by_node, pattern
from smartmesh_ros.node.parameters.specifications import NAMES, SPECS
from smartmesh_ros.yaml_text import parsed_yaml

PRESETS = ("accurate", "fast", "fleet", "quadruped", "rover")
NODE = "/terrain_collider"


def read_parameters(files: Sequence[Path], single: Sequence[str], node: str) -> dict[str, Any]:
    """Return the parameters of files and of entries ``name:=value`` for ``node`` (full name); later ones count. Raises
    `InputError`."""
    values: dict[str, Any] = {}
    for file in files:
        values |= read_file(file, node)
    values |= dict(map(single_value, single))
    require_known(values)
    return values


def require_known(names: Iterable[str]) -> None:
    """Raise `InputError` if one of the ``names`` is no parameter of the node."""
    for name in names:
        if name not in NAMES and name != "use_sim_time" and not name.startswith(QOS):
            raise InputError("parameter", f"parameter {name!r} is unknown{suggestion(name, NAMES)}")


def require_changeable(names: Collection[str]) -> None:
    """Raise `InputError` if one of the ``names`` is a parameter that is fixed after the start."""
    for spec in SPECS:
        if spec.read_only and spec.name in names:
            raise InputError("parameter", f"{spec.name} is fixed after the start; give it to a new run")


def read_file(path: Path, node: str) -> dict[str, Any]:
    """Return the values of a parameter file for ``node`` (full name); raise `InputError` if the file is invalid, or for
    other nodes alone."""
    try:
        content = parsed_yaml(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError("file", f"{path} is no parameter file: {error}") from None
    found: dict[str, Any] = {}
    for name, values in parameters_by_node(content):
        found |= values if re.fullmatch(pattern(name), node) else {}
    if not found:
        none = f"{path} has no {PARAMETERS}; it must read '/**: {{{PARAMETERS}: {{name: value}}}}'"
        raise InputError("file", mismatch(path, node) or none)
    return found


def preset_values(name: str) -> dict[str, Any]:
    """Return the parameters of a preset; raise `InputError` with the known presets if it does not exist."""
    path = Path(get_package_share_directory("smartmesh_ros")) / "config" / f"{name}.yaml"
    if not path.is_file():
        raise InputError("preset", f"there is no preset {name!r}; choose {', '.join(PRESETS)}, or a parameter file")
    return read_file(path, NODE)


def single_value(text: str) -> tuple[str, Any]:
    """Return the name and the value of ``name:=value``; raise `InputError` for any other text."""
    name, mark, value = text.partition(":=")
    if not mark:
        raise InputError("parameter", f"-p {text!r} must be name:=value, as in -p physics.rate:=120.0")
    try:
        return name, parsed_yaml(value)
    except InputError:  # as of what looks like a date, but is none
        return name, value
