"""URDF from ROS: robot names, files, and ``package://`` paths, resolved before the core loads the robot."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from smartmesh_ros.errors import InputError


def robot_name(urdf: str) -> str:
    """Return the robot's name in a URDF text, or "". Raises `InputError` if the text is no URDF."""
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise InputError("urdf", f"the robot is not XML ({error}); xacro files must be expanded first") from None
    if root.tag != "robot":
        raise InputError("urdf_format", f"the robot is a <{root.tag}>; it must be URDF, a <robot>")
    return root.get("name") or ""


def urdf_text(urdf: str) -> str:
    """Return the text of a URDF file; text is returned as is. Raises `InputError` if the file cannot be read."""
    if urdf.lstrip().startswith("<"):
        return urdf
    try:
        return Path(urdf).read_text()
    except (OSError, ValueError) as error:
        raise InputError("urdf", f"there is no URDF file {urdf!r} ({error})") from None


def with_package_paths(urdf: str) -> str:
    """Return a URDF text or path with ``package://<package>`` and ``file://`` replaced by folders. Raises `InputError`
    that names the package if one is not installed."""

    def folder(match: re.Match[str]) -> str:
        try:
            return str(get_package_share_directory(match[1]))
        except (PackageNotFoundError, ValueError):
            raise InputError("urdf_package", f"package {match[1]!r} is not installed, or not sourced") from None

    return re.sub(r"package://([^/\"'<>\s]+)", folder, urdf).replace("file://", "")
