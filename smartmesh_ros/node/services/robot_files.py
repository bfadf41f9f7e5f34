"""URDF from ROS: robot names, files, and ``package://`` paths, resolved before the core loads the robot."""

from __future__ import annotations

import re
from pathlib import Path

from smartmesh_ros.errors import InputError
from smartmesh_ros.world.robots.description import is_text, package_folder, xml_of


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
    """Return a URDF text or path with ``package://<package>`` and ``file://`` replaced by folders. Raises `InputError`
    that names the package of a path if it is not installed; in a text only the packages of collision meshes matter,
    when the robot is loaded."""

    def folder(match: re.Match[str]) -> str:
        if (found := package_folder(match[1])) is not None:
            return str(found)
        if is_text(urdf):
            return match[0]
        raise InputError("urdf_package", f"package {match[1]!r} is not installed, or not sourced")

    return re.sub(r"package://([^/\"'<>\s]+)", folder, urdf).replace("file://", "")
