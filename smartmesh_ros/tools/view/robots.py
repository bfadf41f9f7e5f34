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
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from viser.extras import ViserUrdf

from smartmesh_ros.tools.view.sight import Appearance, Pose, Sight

# yourdfpy warns of every missing mesh, which is normal for a robot of another machine.
logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)
# Height of a robot's label above the base link if the robot's size is unknown, and otherwise above its highest point
# [m].
UNKNOWN_TOP, GAP = 0.6, 0.05
_NO_NUMBERS = re.compile(r"[^-+.\deE\s]")


class Robot:
    """A robot of a viser server. ``readable``: True if its description can be drawn."""

    def __init__(self, server: Any, name: str, appearance: Appearance) -> None:
        self.appearance = appearance
        self._name = name
        self._root = _root_link(appearance.urdf)
        self._frame = server.scene.add_frame(f"/robots/{name}", show_axes=False)
        self._shown: ViserUrdf | None = None
        self._values: list[float] = []
        self._top = UNKNOWN_TOP
        try:
            urdf = _load(appearance)
            self._shown = ViserUrdf(server, urdf, root_node_name=f"/robots/{name}")
            self._joints = list(urdf.actuated_joint_names)
        except Exception:  # noqa: BLE001  # a description may be anything, and the libraries' errors have no common base
            self.readable = False
        else:
            self.readable = True
            self._top = _top_of(urdf)
        self._label = server.scene.add_label(f"/labels/{name}", name, anchor="bottom-center", visible=False)

    def base_in(self, sight: Sight) -> Pose | None:
        """Return the pose of the base link, None if it is not known yet; of a robot whose description cannot be read,
        the pose of its centre of mass."""
        if not self._root:
            return sight.poses.get(self._name)
        return sight.bases.get(f"{self._name}/{self._root}", sight.bases.get(self._root))

    def place(self, base: Pose, joints: dict[str, float]) -> None:
        """Move the base link and the label, and set the joints to positions of ~/joint_states."""
        self._frame.position, self._frame.wxyz = base.position, base.wxyz
        x, y, z = base.position
        self._label.position, self._label.visible = (x, y, z + self._top), True
        if self._shown is None:
            return
        values = [joints.get(f"{self._name}/{joint}", joints.get(joint, 0.0)) for joint in self._joints]
        if values != self._values:
            self._values = values
            self._shown.update_cfg(np.array(values))

    def remove(self) -> None:
        """Remove the robot from the page."""
        self._frame.remove()
        self._label.remove()


def _root_link(urdf: str) -> str:
    """Return the name of the link that is the child of no joint; empty if the text has no such link."""
    try:
        robot = ElementTree.fromstring(urdf)
    except ElementTree.ParseError:
        return ""
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    return next((link.get("name", "") for link in robot.iterfind("link") if link.get("name") not in children), "")


def _load(appearance: Appearance) -> yourdfpy.URDF:
    folder = Path(appearance.urdf_file).parent if appearance.urdf_file else None

    def found(fname: str) -> str:
        return str(_path(fname, folder))

    text = _readable(appearance.urdf, folder)
    return yourdfpy.URDF.load(io.BytesIO(text), filename_handler=found, load_meshes=True)


def _top_of(urdf: yourdfpy.URDF) -> float:
    """Return the height [m] of a label above the base link."""
    bounds = urdf.scene.bounds
    return UNKNOWN_TOP if bounds is None else float(bounds[1][2]) + GAP


def _path(name: str, folder: Path | None) -> Path:
    """Return the path of a mesh. If its package is not installed, the path may not exist."""
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        try:
            return Path(get_package_share_directory(package)) / rest
        except (PackageNotFoundError, ValueError):
            return Path(rest)
    path = Path(name.removeprefix("file://"))
    return path if folder is None or path.is_absolute() else folder / path


def _readable(urdf: str, folder: Path | None) -> bytes:
    """Return a description that this machine can draw: non-numeric origins become zeros, as in PyBullet, and links
    whose meshes are missing are drawn by their collision shapes."""
    root = ElementTree.fromstring(urdf)
    for origin in root.iter("origin"):
        for key in ("xyz", "rpy"):
            if _NO_NUMBERS.search(origin.get(key, "")):
                origin.set(key, "0 0 0")
    for link in root.iter("link"):
        for part in [*link.iterfind("visual"), *link.iterfind("collision")]:
            mesh = part.find("geometry/mesh")
            if mesh is not None and not _path(mesh.get("filename", ""), folder).is_file():
                link.remove(part)
        if link.find("visual") is None:
            for part in link.iterfind("collision"):
                part.tag = "visual"
    return bytes(ElementTree.tostring(root))
