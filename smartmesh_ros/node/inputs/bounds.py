"""Limits on what peers may request: numbers of bodies and tiles, lengths of names, folders of robots."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import pybullet_data

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.urdf import UrdfRules
from smartmesh_ros.node.parameters.settings import LONGEST_NAME, Settings
from smartmesh_ros.terrain.terrain import Terrain


def require_name(name: str) -> None:
    """Raises `InputError` if the name of a body, tile or frame is too long."""
    if len(name) > LONGEST_NAME:
        raise InputError("size", f"a name of {len(name)} characters; at most {LONGEST_NAME} are possible")


def require_room(names: Iterable[str], known: Iterable[str], settings: Settings) -> None:
    """Raises `InputError` if ``known`` and ``names`` together are too many bodies."""
    count = len({*known, *names})
    if count > settings.most_bodies:
        raise InputError("size", f"{count} bodies are more than bodies.most = {settings.most_bodies}")


def require_tile_fits(name: str, samples: int, terrain: Terrain, settings: Settings) -> None:
    """Raises `InputError` if the terrain with this tile would have too many tiles, or too many samples in all tiles."""
    others = [mesh for tile, mesh in terrain.tiles.items() if tile != name]
    if len(others) >= settings.most_tiles:
        raise InputError("size", f"{len(others) + 1} tiles are more than terrain.max_tiles = {settings.most_tiles}")
    total = samples + sum(mesh.size for mesh in others)
    if total > settings.max_samples:
        raise InputError("size", f"{total} samples in all are more than terrain.max_samples = {settings.max_samples}")


def urdf_rules(settings: Settings) -> UrdfRules:
    """Return the rules for robot descriptions that a service names."""
    return UrdfRules(folders=_folders(settings), longest=settings.longest_urdf)


def _folders(settings: Settings) -> tuple[Path, ...]:
    if settings.urdf_folders:
        return tuple(Path(folder) for folder in settings.urdf_folders)
    prefixes = [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return Path(pybullet_data.getDataPath()), *(Path(prefix) / "share" for prefix in prefixes)
