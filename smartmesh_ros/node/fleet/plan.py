"""The commands that start the processes of a fleet, with or without a ROS installation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_prefix

from smartmesh_ros.node.fleet import layout

PACKAGE = "smartmesh_ros"


@dataclass(frozen=True, kw_only=True)
class FleetPlan:
    """A fleet of ``count`` nodes. ``parameters`` are for all nodes, ``front`` and ``source`` for the front and for
    terrain_source. Each command writes its parameter file into a ``folder``."""

    count: int
    parameters: dict[str, Any] = field(default_factory=dict)
    front: dict[str, Any] = field(default_factory=dict)
    source: dict[str, Any] = field(default_factory=dict)

    def node(self, index: int, folder: Path) -> list[str]:
        """Return the command of node ``index``."""
        preset = Path(get_package_prefix(PACKAGE)) / "share" / PACKAGE / "config" / f"{layout.PRESET}.yaml"
        own = _file(folder / f"node_{index}.yaml", {**layout.parameters_of(index, self.count), **self.parameters})
        return _command(layout.COLLIDER, [preset, own], [("__ns", layout.namespace_of(index)), *layout.remappings()])

    def front_command(self, folder: Path) -> list[str]:
        """Return the command of the front."""
        return _command(
            "fleet_front", [_file(folder / "front.yaml", {"nodes": layout.node_names(self.count), **self.front})]
        )

    def source_command(self, folder: Path) -> list[str]:
        """Return the command of terrain_source."""
        return _command("terrain_source", [_file(folder / "source.yaml", self.source)], layout.source_remappings())


def _file(path: Path, parameters: dict[str, Any]) -> Path:
    # ROS cannot tell the type of an empty list in YAML.
    plain = {name: value for name, value in parameters.items() if value != []}
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
    return path


def _command(name: str, files: list[Path], names: Sequence[tuple[str, str]] = ()) -> list[str]:
    options = [part for file in files for part in ("--params-file", str(file))]
    options += [part for old, new in names for part in ("-r", f"{old}:={new}")]
    return [str(Path(get_package_prefix(PACKAGE)) / "lib" / PACKAGE / name), "--ros-args", *options]
