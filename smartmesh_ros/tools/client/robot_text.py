"""A robot's file as text, for a node that cannot see the folder."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

from smartmesh_ros.errors import InputError
from smartmesh_ros.world.robots.description import named_file, urdf_text, xml_of


def text_of(file: Path) -> str:
    """Return the text of a URDF file, whose meshes are named by their full paths where they are found. Raises
    `InputError`."""
    robot = xml_of(urdf_text(str(file)))
    for mesh in robot.iter("mesh"):
        if not (name := mesh.get("filename", "")).startswith("package://"):
            with suppress(InputError):  # the node opens meshes of collision shapes alone, and says which are missing
                mesh.set("filename", str(named_file(name, file.absolute().parent)))
    return ElementTree.tostring(robot, encoding="unicode")
