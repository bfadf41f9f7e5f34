"""Names, parameters, remappings and commands of a fleet: nodes that share one terrain, and their front.

Used by the launch file and by ``smartmesh-fleet``. Imports nothing of ROS but its index of packages.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_prefix

from smartmesh_ros.startup.executables import executable

PACKAGE = "smartmesh_ros"
COLLIDER, FRONT, PRESET = "terrain_collider", "fleet", "fleet"
# Topics under the front's name that all nodes subscribe to or publish on.
SHARED = ("heightmap", "heightmap_update", "terrain_mesh", "terrain_mesh_update", "patches", "scene")
# Rate of body states [Hz], above any physics rate: peers need the states of every step.
EVERY_STEP = 1000.0
# Parameters of terrain_source for trying a fleet: travelling waves, in maps at a lidar's rate.
WAVES = {"scene": "waves", "rate": 20.0, "wave.amplitude": 0.1, "wave.number": 0.5, "wave.frequency": 2.0}


def front_of(namespace: str = "") -> str:
    """Return the full name of the front."""
    inner = namespace.strip("/")
    return f"/{inner}/{FRONT}" if inner else f"/{FRONT}"


def namespace_of(index: int, namespace: str = "") -> str:
    """Return the namespace of a node. The prefix is needed because a ROS name must not start with a digit."""
    return f"{front_of(namespace)}/node_{index}"


def node_names(count: int, namespace: str = "") -> list[str]:
    """Return the full names of the nodes."""
    return [f"{namespace_of(index, namespace)}/{COLLIDER}" for index in range(count)]


def parameters_of(index: int, count: int, namespace: str = "") -> dict[str, Any]:
    """Return a node's parameters beside its preset: its peers, and its states in every step."""
    names = node_names(count, namespace)
    return {"bodies.peers": [*names[:index], *names[index + 1 :]] or ["auto"], "publish.body_states": EVERY_STEP}


def marker_namespace(node: str) -> str:
    """Return the ``ns`` of a node's markers on the topic that all of them share."""
    return node.strip("/").removesuffix(f"/{COLLIDER}")


def remappings(namespace: str = "") -> list[tuple[str, str]]:
    return [(f"~/{topic}", f"{front_of(namespace)}/{topic}") for topic in SHARED]


def source_remappings(namespace: str = "") -> list[tuple[str, str]]:
    return [(f"{COLLIDER}/{topic}", f"{front_of(namespace)}/{topic}") for topic in ("heightmap", "heightmap_update")]


def commands(
    folder: Path, count: int, front: dict[str, Any], parameters: dict[str, Any] | None = None
) -> dict[str, list[str]]:
    """Return the commands of the processes of a fleet of ``count`` nodes by name: ``source``, ``front``,
    ``node_<index>``. They read parameter files that are written into a ``folder``. ``front``, ``parameters``: of the
    front and of all nodes, beside their own."""
    known = {"nodes": node_names(count), **front}
    found = {
        "source": _command("terrain_source", [_file(folder / "source.yaml", WAVES)], source_remappings()),
        "front": _command("fleet_front", [_file(folder / "front.yaml", known)]),
    }
    preset = Path(get_package_prefix(PACKAGE)) / "share" / PACKAGE / "config" / f"{PRESET}.yaml"
    for index in range(count):
        own = _file(folder / f"node_{index}.yaml", {**parameters_of(index, count), **(parameters or {})})
        names = [("__ns", namespace_of(index)), *remappings()]
        found[f"node_{index}"] = _command(COLLIDER, [preset, own], names)
    return found


def _file(path: Path, parameters: dict[str, Any]) -> Path:
    # ROS cannot tell the type of an empty list in YAML.
    plain = {name: value for name, value in parameters.items() if value != []}
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
    return path


def _command(name: str, files: list[Path], names: Sequence[tuple[str, str]] = ()) -> list[str]:
    options = [part for file in files for part in ("--params-file", str(file))]
    options += [part for old, new in names for part in ("-r", f"{old}:={new}")]
    return [str(executable(name)), "--ros-args", *options]
