"""Robots from ROS: names, files and ``package://`` paths of URDF, and their preparation while the physics steps."""

from __future__ import annotations

import os
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import unquote

import pybullet_data

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.urdf import UrdfRules, checked_urdf
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.services.turns import NextTurn
from smartmesh_ros.world.robots.description import is_text, package_folder, xml_of
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.robots.workshop import WORKSHOP


def robot_name(urdf: str) -> str:
    """Return the robot's name in a URDF text, or "". Raises `InputError` if the text is no URDF."""
    return xml_of(urdf).get("name") or ""


def urdf_text(urdf: str) -> str:
    """Return the text of a URDF file; text is returned as is. Raises `InputError` if the file cannot be read."""
    if is_text(urdf):
        return urdf
    try:
        return Path(urdf).read_text()
    except (OSError, ValueError) as error:
        raise InputError("urdf", f"there is no URDF file {urdf!r} ({error})") from None


def with_package_paths(urdf: str) -> str:
    """Return the path that a URI names by ``package://<package>`` or ``file://``, with ``%20`` for a space; other paths
    and URDF texts are returned as they are. Raises `InputError` if the package is not installed."""

    def folder(match: re.Match[str]) -> str:
        if (found := package_folder(match[1])) is not None:
            return str(found)
        raise InputError("urdf_package", f"package {match[1]!r} is not installed, or not sourced")

    if is_text(urdf):  # `named_file` reads the names in it
        return urdf
    path = re.sub("^file://(localhost(?=/))?", "", re.sub("^package://([^/]+)", folder, urdf))
    return path if path == urdf or Path(path).exists() else unquote(path)


def _folders(settings: Settings) -> tuple[Path, ...]:
    """Return the folders from which peers may let robots be loaded."""
    if settings.urdf_folders:
        return tuple(Path(folder) for folder in settings.urdf_folders)
    prefixes = [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return Path(pybullet_data.getDataPath()), *(Path(prefix) / "share" for prefix in prefixes)


class RobotPreparation:
    """Prepares robots one after another in a thread."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix="robots")

    async def prepared(self, urdf: str, settings: Settings) -> PreparedRobot:
        """Return the robot of a URDF text or path that a peer sent. Raises `InputError`."""
        rules = UrdfRules(folders=_folders(settings))
        future = self._threads.submit(lambda: prepare_robot(checked_urdf(with_package_paths(urdf), rules)))
        while not future.done():
            await NextTurn(waits=True)
        return future.result()

    def close(self) -> None:
        """Give up all work."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        WORKSHOP.close()
