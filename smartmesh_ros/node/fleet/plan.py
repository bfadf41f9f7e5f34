"""The commands that start the processes of a fleet, with or without a ROS installation."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_prefix

from smartmesh_ros.node.fleet import layout as layout

PACKAGE = "smartmesh_ros"


@dataclass(frozen=True, kw_only=True)
class FleetPlan:
    """A fleet of ``count`` nodes in a ``namespace``. ``preset`` (empty = none) and ``parameters`` are for all nodes,
    ``front`` and ``source`` are parameters of the front and of terrain_source."""

    count: int
    namespace: str = ""
    preset: str = layout.PRESET
    parameters: dict[str, Any] = field(default_factory=dict)
    front: dict[str, Any] = field(default_factory=dict)
    source: dict[str, Any] = field(default_factory=dict)

    def node(self, index: int, folder: Path) -> list[str]:
        """Return the command of node ``index``; write its parameter file into ``folder``."""
        own = layout.parameters_of(index, self.count, self.namespace)
        files = [str(_share() / "config" / f"{self.preset}.yaml")] if self.preset else []
        files.append(_file(folder / f"node_{index}.yaml", {**own, **self.parameters}))
        names = [("__ns", layout.namespace_of(index, self.namespace)), *layout.remappings(self.namespace)]
        return _command(layout.COLLIDER, files, names)

    def front_command(self, folder: Path) -> list[str]:
        """Return the command of the front."""
        own = layout.front_parameters(self.count, self.namespace)
        files = [_file(folder / "front.yaml", {**own, **self.front})]
        return _command("fleet_front", files, [("__ns", self.namespace)] if self.namespace else [])

    def source_command(self, folder: Path) -> list[str]:
        """Return the command of terrain_source."""
        files = [_file(folder / "source.yaml", self.source)] if self.source else []
        return _command("terrain_source", files, layout.source_remappings(self.namespace))


def _share() -> Path:
    return Path(get_package_prefix(PACKAGE)) / "share" / PACKAGE


def _file(path: Path, parameters: dict[str, Any]) -> str:
    # ROS cannot tell the type of an empty list in YAML.
    plain = {name: value for name, value in parameters.items() if value != []}
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
    return str(path)


def _command(name: str, files: list[str], names: list[tuple[str, str]]) -> list[str]:
    path = Path(get_package_prefix(PACKAGE)) / "lib" / PACKAGE / name
    options = [part for file in files for part in ("--params-file", file)]
    options += [part for old, new in names for part in ("-r", f"{old}:={new}")]
    return [str(path), "--ros-args", *options]
