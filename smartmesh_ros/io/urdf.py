"""Validation of untrusted robot descriptions.

A description names files that are then opened. So the description and the meshes of its collision shapes must lie in an
allowed folder, after symbolic links are resolved. Files of visuals are never opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from smartmesh_ros.errors import InputError, listed
from smartmesh_ros.world.robots.description import is_text, located, named_file, read_description
from smartmesh_ros.world.robots.quantities import check_quantities

# Maximum length of a description [bytes], and number of links of a robot.
LONGEST, MOST_LINKS = 10_000_000, 1000
# Most allowed folders that a refusal names.
MOST_FOLDERS = 3
# What a refusal of a description's path proposes. It would not help a mesh, which must be allowed in a text, too.
AS_TEXT = ", or send the text instead of the path"


def checked_urdf(urdf: str, folders: Sequence[Path]) -> str:
    """Return a description that is safe to load: the text itself, or the resolved path of its file, which must be in
    one of the allowed ``folders``, as its meshes must. Raises `InputError`."""
    urdf = located(urdf)
    length = len(urdf)
    if not is_text(urdf):
        path = require_inside(Path(urdf), folders, f"URDF file {str(Path(urdf).absolute())!r}", cure=AS_TEXT)
        if not path.is_file():
            raise InputError("urdf", f"there is no URDF file {urdf!r}")
        urdf, length = str(path), path.stat().st_size
    if length > LONGEST:
        raise InputError("size", f"the URDF has {length} bytes; the maximum is {LONGEST}")
    robot = read_description(urdf)
    if len(robot.links) > MOST_LINKS:
        raise InputError("size", f"the URDF has {len(robot.links)} links; the maximum is {MOST_LINKS}")
    check_quantities(robot)
    for link in robot.links:
        for collision in robot.collisions(link):
            for mesh in collision.iter("mesh"):
                name = mesh.get("filename", "")
                require_inside(named_file(name, robot.folder), folders, f"the URDF names the file {name!r}, which")
    return urdf


def require_inside(path: Path, folders: Sequence[Path], what: str, cure: str = "") -> Path:
    """Return the resolved path of a file or folder; raises `InputError` if it is in none of the allowed ``folders``.
    ``cure``: what else would be right."""
    resolved = _resolved(path)
    if not any(resolved.is_relative_to(_resolved(folder)) for folder in folders):
        known = listed([*map(str, folders)], MOST_FOLDERS) or "none"
        raise InputError(
            "folder", f"{what} is not in bodies.urdf_folders: add its folder there, which takes effect at once{cure}; "
            f"allowed now: {known}"
        )  # fmt: skip
    return resolved


def _resolved(path: Path) -> Path:
    try:
        resolved = path.resolve()
        resolved.exists()  # fails for names that are too long
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError("urdf", f"{str(path)[:200]!r} is not a path: {error}") from None
    return resolved
