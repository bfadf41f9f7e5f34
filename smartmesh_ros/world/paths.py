"""Paths and URIs by which files and folders are named: of terrain, worlds, robots and their meshes."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote

import pybullet_data

from smartmesh_ros.errors import InputError


def ament_prefixes() -> list[Path]:
    """Return where ROS packages are installed, by the environment's AMENT_PREFIX_PATH."""
    return [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def package_folder(name: str) -> Path | None:
    """Return the share folder of an installed ROS package, or the folder of ``pybullet_data`` by that name; None if
    there is none."""
    if name == "pybullet_data":
        return Path(pybullet_data.getDataPath())
    if not name or "/" in name or name.startswith("."):
        return None
    for prefix in ament_prefixes():
        if (prefix / "share/ament_index/resource_index/packages" / name).is_file():
            return prefix / "share" / name
    return None


def expanded(name: str | os.PathLike[str]) -> Path:
    """Return the path that is given as the ``name`` of a file or folder. ``~`` is a user's home, and stays if there is
    no such user; ``package://<package>`` is the folder of an installed package; ``file://`` is left out. In a URI
    ``%20`` and the like may stand for characters. Raises `InputError` if the package is not installed, and for a URI of
    another scheme."""

    def folder(match: re.Match[str]) -> str:
        if (found := package_folder(match[1])) is not None:
            return str(found)
        raise InputError("urdf_package", f"package {match[1]!r} is not installed, or not sourced")

    name = os.fspath(name)
    path = re.sub("^file://(localhost(?=/))?", "", re.sub("^package://([^/]+)", folder, name))
    if re.match(r"\w+://", path):
        raise InputError("folder", f"{name[:200]!r} cannot be opened; give a path, or a URI with file:// or package://")
    if path != name and not os.path.exists(path):  # noqa: PTH110  # False for what is no path
        path = unquote(path)
    with suppress(RuntimeError, ValueError):
        return Path(path).expanduser()
    return Path(path)
