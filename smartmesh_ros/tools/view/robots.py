"""Robots on the page, from their URDF."""

from __future__ import annotations

import io
import logging
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import yourdfpy
from smartmesh_msgs.msg import BodyDescription
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial
from viser.extras import ViserUrdf

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.client.sight import Sight
from smartmesh_ros.world.robots.description import named_file, xml_of

# yourdfpy warns of every missing mesh, which is normal for a robot of another machine.
logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)
# Height [m] of a robot's label above a base link of unknown size, and else above the robot's highest point.
UNKNOWN_TOP, GAP = 0.6, 0.05
_NO_NUMBERS = re.compile(r"[^-+.\deE\s]")


class Robot:
    """A robot of a viser server. ``fault``: why its description cannot be drawn; empty if it is drawn."""

    def __init__(self, server: Any, name: str, appearance: BodyDescription) -> None:
        self.appearance, self._name = appearance, name
        self._frame = server.scene.add_frame(f"/robots/{name}", show_axes=False)
        self._joints: list[str] = []
        self._values: list[float] = []
        self._root, self._top, self.fault = "", UNKNOWN_TOP, ""
        try:
            urdf = yourdfpy.URDF.load(io.BytesIO(_drawable(appearance)), filename_handler=lambda fname: fname)
            for mesh in urdf.scene.geometry.values():
                mesh.visual = _matt(mesh.visual)
            self._shown = ViserUrdf(server, urdf, root_node_name=f"/robots/{name}")
            self._root, self._joints = urdf.base_link, list(urdf.actuated_joint_names)
            self._values = [0.0] * len(self._joints)
            self._shown.update_cfg(np.array(self._values))  # ViserUrdf itself places no link, not even a fixed one
            if (bounds := urdf.scene.bounds) is not None:
                self._top = float(bounds[1][2]) + GAP
        except Exception as error:  # noqa: BLE001  # a description may be anything; the errors have no common base
            self.fault = f"its description cannot be read ({error})"
            if not appearance.urdf:
                self.fault = f"its file {appearance.urdf_file} is gone from the node's machine"
        self._label = server.scene.add_label(f"/labels/{name}", name, anchor="bottom-center", visible=False)

    def show(self, sight: Sight) -> None:
        """Move the base link, the label and the joints, once the pose of the base link is known; of a robot whose
        description cannot be read, the pose of its centre of mass."""
        base = sight.bases.get(f"{self._name}/{self._root}", sight.bases.get(self._root))
        base = base if self._root else sight.poses.get(self._name)
        if base is None:
            return
        self._frame.position, self._frame.wxyz = base
        x, y, z = base.position
        self._label.position, self._label.visible = (x, y, z + self._top), True
        values = [sight.joints.get(f"{self._name}/{joint}", sight.joints.get(joint, 0.0)) for joint in self._joints]
        if values != self._values:
            self._values = values
            self._shown.update_cfg(np.array(values))

    def remove(self) -> None:
        """Remove the robot from the page."""
        self._frame.remove()
        self._label.remove()


def _matt(visual: Any) -> TextureVisuals:
    """Return colours of a mesh as a matt material. A mesh without one is metal to glTF, which is black here."""
    if isinstance(visual, TextureVisuals):
        material = visual.material
        material = material if isinstance(material, PBRMaterial) else material.to_pbr()
    else:
        visual, material = TextureVisuals(), PBRMaterial(baseColorFactor=visual.main_color)
    visual.material, material.metallicFactor = material, 0.0
    return visual


def _drawable(appearance: BodyDescription) -> bytes:
    """Return a description that this machine can draw: non-numeric origins become zeros, as in PyBullet, meshes have
    the paths of their files, and links whose meshes are missing are drawn by their collision shapes."""
    folder = Path(appearance.urdf_file).parent if appearance.urdf_file else None
    root = xml_of(appearance.urdf)
    root[:0] = root.findall("link/visual/material[color]")  # other links may name them
    for capsule in root.iter("capsule"):  # which PyBullet reads, but yourdfpy does not
        capsule.tag = "cylinder"
    for joint in root.iterfind("joint[@type='spherical']"):  # neither
        joint.set("type", "fixed")
    for origin in root.iter("origin"):
        for key in ("xyz", "rpy"):
            if _NO_NUMBERS.search(origin.get(key, "")):
                origin.set(key, "0 0 0")
    for link in root.iter("link"):
        for part in [*link.iterfind("visual"), *link.iterfind("collision")]:
            for mesh in part.iterfind("geometry/mesh"):
                try:
                    mesh.set("filename", str(named_file(mesh.get("filename", ""), folder)))
                except InputError:
                    link.remove(part)
        if link.find("visual") is None:
            for part in link.iterfind("collision"):
                part.tag = "visual"
    return bytes(ElementTree.tostring(root))
