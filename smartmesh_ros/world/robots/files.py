"""Files that a robot description names."""

from __future__ import annotations

import os
import re
from pathlib import Path

from smartmesh_ros.errors import InputError

_SCHEME = re.compile(r"(package|model|file)://")


def package_folder(name: str) -> Path | None:
    """Return the share folder of a ROS package by the environment's AMENT_PREFIX_PATH, None if there is none."""
    if not name or "/" in name or name.startswith("."):
        return None
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        if (Path(prefix) / "share/ament_index/resource_index/packages" / name).is_file():
            return Path(prefix) / "share" / name
    return None


def named_file(name: str, folder: Path | None) -> Path:
    """Return the file that a description in ``folder`` (None = a text) names; symbolic links are resolved.

    ``package://<package>/...`` is a file of an installed package, or else is searched as a relative path is: in the
    folder of the description, those above it, and the working directory. Raises `InputError` if there is no file.
    """
    if "\0" in name or not name.strip():
        raise InputError("urdf", f"the URDF names a file {name!r}")
    scheme = _SCHEME.match(name)
    rest = name[scheme.end() :] if scheme else name
    package, _, inside = rest.partition("/")
    candidates = [Path(rest)] if rest.startswith("/") else []
    if scheme and scheme[1] == "package" and (share := package_folder(package)) is not None:
        candidates.append(share / inside)
    above = [] if folder is None else [folder, *folder.parents]
    candidates += [place / rest for place in (*above, Path.cwd())]
    try:
        found = next((path for path in candidates if path.is_file()), None)
        if found is not None:
            return found.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError("urdf", f"{name[:200]!r} is not a path: {error}") from None
    if scheme and scheme[1] == "package" and package_folder(package) is None:
        raise InputError("urdf_package", f"package {package!r} is not installed, or not sourced")
    raise InputError("urdf", f"the URDF names a file {name[:200]!r} that does not exist")
