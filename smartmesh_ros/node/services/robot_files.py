"""URDF as ROS hands it over, before the core loads it."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from smartmesh_ros.errors import InputError


def robot_name(urdf: str) -> str:
    """The name that a URDF text gives its robot, or "". Raises `InputError` if the text is no URDF."""
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise InputError("urdf", f"the robot is not XML ({error}); xacro files must be expanded first") from None
    if root.tag != "robot":
        raise InputError("urdf_format", f"the robot is a <{root.tag}>; it must be URDF, a <robot>")
    return root.get("name") or ""


def urdf_text(urdf: str) -> str:
    """The text of a URDF file, or the text itself. Raises `InputError` if there is no such file."""
    if urdf.lstrip().startswith("<"):
        return urdf
    try:
        return Path(urdf).read_text()
    except (OSError, ValueError) as error:
        raise InputError("urdf", f"there is no URDF file {urdf!r} ({error})") from None


def with_package_paths(urdf: str) -> str:
    """A text or path with folders in place of ``package://<package>`` and ``file://``. Raises `InputError` naming a
    package that is not there."""

    def folder(match: re.Match[str]) -> str:
        try:
            return str(get_package_share_directory(match[1]))
        except (PackageNotFoundError, ValueError):
            raise InputError("urdf_package", f"package {match[1]!r} is not installed, or not sourced") from None

    return re.sub(r"package://([^/\"'<>\s]+)", folder, urdf).replace("file://", "")
