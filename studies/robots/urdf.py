"""Descriptions of robots that every engine's loader takes."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

# Mass of links whose description gives none [kg]. Loaders differ: PyBullet takes 1 kg, others nothing.
MASSLESS = 0.01
# What a file of husky has kept of its macros: the value of an environment variable, or what stands behind its name.
_OPTIONAL = re.compile(r"\$\(optenv \w+ ([^)]*)\)")


def prepared(urdf: str) -> str:
    """Return the text of a URDF file or text with what loaders agree about: links, joints and collision shapes.

    Paths of meshes are absolute. Pictures and extensions are left out. Links without a mass get a small one.
    """
    is_text = urdf.lstrip().startswith("<")
    root = ET.fromstring(urdf) if is_text else ET.parse(urdf).getroot()
    for part in list(root):
        if part.tag not in ("link", "joint"):
            root.remove(part)
    for link in root.iter("link"):
        for tag in ("visual", "contact"):
            for part in link.findall(tag):
                link.remove(part)
        if link.find("inertial") is None:
            link.append(_inertial(MASSLESS))
    for part in root.iter():
        for name, value in part.attrib.items():
            part.set(name, _OPTIONAL.sub(r"\1", value))
    folder = Path() if is_text else Path(urdf).parent
    for mesh in root.iter("mesh"):
        mesh.set("filename", str((folder / mesh.attrib["filename"]).resolve()))
    return ET.tostring(root, encoding="unicode")


def _inertial(mass: float) -> ET.Element:
    """Return the inertia of a ball of 0.1 m."""
    moment = f"{0.4 * mass * 0.1**2:g}"
    found = ET.Element("inertial")
    ET.SubElement(found, "mass", value=f"{mass:g}")
    ET.SubElement(found, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")
    return found


def root_link(text: str) -> str:
    """Return the name of the link that is no child of any joint."""
    root = ET.fromstring(text)
    children = {child.attrib["link"] for joint in root.iter("joint") for child in joint.findall("child")}
    [name] = [link.attrib["name"] for link in root.iter("link") if link.attrib["name"] not in children]
    return name
