"""Files that services name: allowed folders, URDF, and their reading while the physics steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import pybullet_data

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.urdf import checked_urdf, require_inside
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.node.services.turns import next_turn
from smartmesh_ros.world.paths import ament_prefixes, expanded
from smartmesh_ros.world.robots.description import xml_of
from smartmesh_ros.world.robots.prepared import PreparedRobot, prepare_robot
from smartmesh_ros.world.robots.workshop import WORKSHOP

Found = TypeVar("Found")


def robot_name(urdf: str) -> str:
    """Return the robot's name in a URDF text, or "". Raises `InputError` if the text is no URDF."""
    return xml_of(urdf).get("name") or ""


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
            place = require_inside(expanded(source), allowed_folders(settings), repr(source[:200]))
            if not place.is_dir():
                raise InputError("file", f"there is no folder {source[:200]!r}")
            places.append(place)
        except InputError as error:
            wrong.append(str(error))
    found = {path for place in places for path in place.rglob("*") if path.suffix.lower() in suffixes}
    return sorted(path for path in found if path.is_file()), wrong


def robot_of(urdf: str, settings: Settings) -> PreparedRobot:
    """Return the robot of a URDF text or path that a peer sent. Raises `InputError`."""
    return prepare_robot(checked_urdf(urdf, allowed_folders(settings)))


class FileWork:
    """Reads files and prepares robots, one after another in a thread."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(max_workers=1, thread_name_prefix="files")

    async def done(self, work: Callable[[], Found]) -> Found:
        """Return the result of long work on files. Raises `InputError`, also in place of errors of the file system."""
        future = self._threads.submit(work)
        while not future.done():
            await next_turn(waits=True)
        try:
            return future.result()
        except OSError as error:
            raise InputError("file", f"{error.filename!s:.200}: {error.strerror}") from None

    async def prepared(self, urdf: str, settings: Settings) -> PreparedRobot:
        return await self.done(lambda: robot_of(urdf, settings))

    def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        WORKSHOP.close()
