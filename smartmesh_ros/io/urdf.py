"""Validation of untrusted robot descriptions.

A description names files that are then opened. So the description and the meshes of its collision shapes must lie in an
allowed folder, after symbolic links are resolved. Files of visuals are never opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.world.robots.description import is_text, named_file, read_description
from smartmesh_ros.world.robots.quantities import check_quantities


@dataclass(frozen=True, kw_only=True)
class UrdfRules:
    """``folders``: allowed for descriptions and meshes. ``longest``: maximum length of a description [bytes].
    ``most_links``: maximum number of links of a robot."""

    folders: tuple[Path, ...]
    longest: int = 10_000_000
    most_links: int = 1000


# Most allowed folders that a refusal names.
MOST_FOLDERS = 3


def checked_urdf(urdf: str, rules: UrdfRules) -> str:
    """Return a description that is safe to load: the text itself, or the resolved path of its file.

    Raises `InputError`.
    """
    if is_text(urdf):
        _require_length(len(urdf), rules)
    else:
        path = require_inside(Path(urdf), rules.folders, f"URDF file {urdf!r}")
        if not path.is_file():
            raise InputError("urdf", f"there is no URDF file {urdf!r}")
        _require_length(path.stat().st_size, rules)
        urdf = str(path)
    robot = read_description(urdf)
    if len(robot.links) > rules.most_links:
        raise InputError("size", f"the URDF has {len(robot.links)} links; the maximum is {rules.most_links}")
    check_quantities(robot)
    for link in robot.links:
        for collision in robot.collisions(link):
            for mesh in collision.iter("mesh"):
                name = mesh.get("filename", "")
                named = named_file(name, robot.folder)
                require_inside(named, rules.folders, f"the URDF names the file {name!r}, which")
    return urdf


def require_inside(path: Path, folders: Sequence[Path], what: str) -> Path:
    """Return the resolved path of a file or folder; raises `InputError` if it is in none of the allowed ``folders``."""
    resolved = _resolved(path)
    if not any(resolved.is_relative_to(_resolved(folder)) for folder in folders):
        known = listed([*map(str, folders)], MOST_FOLDERS) or "none"
        raise InputError(
            "folder", f"{what} is not in bodies.urdf_folders: add its folder there, which takes effect at once, or "
            f"send the text instead of the path; allowed now: {known}"
        )  # fmt: skip
    return resolved


def _resolved(path: Path) -> Path:
    try:
        resolved = path.expanduser().resolve()
        resolved.exists()  # fails for names that are too long
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError("urdf", f"{str(path)[:200]!r} is not a path: {error}") from None
    return resolved


def _require_length(length: int, rules: UrdfRules) -> None:
    if length > rules.longest:
        raise InputError("size", f"the URDF has {length} bytes; the maximum is {rules.longest}")
