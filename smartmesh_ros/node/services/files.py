"""Files that services name: ``package://`` paths, allowed folders, URDF, and their reading while the physics steps."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote

import pybullet_data

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.files import expanded
from smartmesh_ros.io.urdf import checked_urdf, require_inside
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.services.turns import NextTurn
from smartmesh_ros.world.robots.description import ament_prefixes, is_text, package_folder, xml_of
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.robots.workshop import WORKSHOP

Found = TypeVar("Found")
# What texts of editors on Windows may begin with.
BYTE_ORDER_MARK = "\ufeff"


def robot_name(urdf: str) -> str:
    """Return the robot's name in a URDF text, or "". Raises `InputError` if the text is no URDF."""
    return xml_of(urdf.removeprefix(BYTE_ORDER_MARK)).get("name") or ""


def with_package_paths(urdf: str) -> str:
    """Return the path that a URI names by ``package://<package>`` or ``file://``, with ``%20`` for a space; other paths
    are returned as they are, and URDF texts without a byte order mark. Raises `InputError` if the package is not
    installed, or it is no path."""

    def folder(match: re.Match[str]) -> str:
        if (found := package_folder(match[1])) is not None:
            return str(found)
        raise InputError("urdf_package", f"package {match[1]!r} is not installed, or not sourced")

    urdf = urdf.removeprefix(BYTE_ORDER_MARK)
    if is_text(urdf):  # `named_file` reads the names in it
        return urdf
    try:
        path = re.sub("^file://(localhost(?=/))?", "", re.sub("^package://([^/]+)", folder, urdf))
        return path if path == urdf or Path(path).exists() else unquote(path)
    except OSError as error:
        raise InputError("urdf", f"{urdf[:200]!r} is not a path: {error.strerror}") from None


def allowed_folders(settings: Settings) -> tuple[Path, ...]:
    """Return the folders from which peers may let files be loaded."""
    if settings.urdf_folders:
        return tuple(map(expanded, settings.urdf_folders))
    return Path(pybullet_data.getDataPath()), *(prefix / "share" for prefix in ament_prefixes())


def files_in(
    folders: Iterable[Path], sources: Iterable[str], suffixes: tuple[str, ...], settings: Settings
) -> tuple[list[Path], list[str]]:
    """Return the files with one of the ``suffixes`` below some folders and those that ``sources`` name by path or URI,
    sorted; and what is wrong with each source that is no allowed folder."""
    places, wrong = [*folders], []
    for source in sources:
        try:
            path, folders = Path(with_package_paths(source)), allowed_folders(settings)
            place = require_inside(path, folders, repr(source[:200]), cure="")
            if not place.is_dir():
                raise InputError("file", f"there is no folder {source[:200]!r}")
            places.append(place)
        except InputError as error:
            wrong.append(str(error))
    found = {path for place in places for path in place.rglob("*") if path.suffix.lower() in suffixes}
    return sorted(path for path in found if path.is_file()), wrong


def robot_of(urdf: str, settings: Settings) -> PreparedRobot:
    """Return the robot of a URDF text or path that a peer sent. Raises `InputError`."""
    return prepare_robot(checked_urdf(with_package_paths(urdf), allowed_folders(settings)))


class FileWork:
    """Reads files and prepares robots, one after another in a thread."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix="files")

    async def done(self, work: Callable[[], Found]) -> Found:
        """Return the result of long work on files. Raises `InputError`, also in place of errors of the file system."""
        future = self._threads.submit(work)
        while not future.done():
            await NextTurn(waits=True)
        try:
            return future.result()
        except OSError as error:
            raise InputError("file", f"{error.filename!s:.200}: {error.strerror}") from None

    async def prepared(self, urdf: str, settings: Settings) -> PreparedRobot:
        return await self.done(lambda: robot_of(urdf, settings))

    def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        WORKSHOP.close()
