"""Robots prepared for PyBullet: descriptions rewritten so that PyBullet loads them quickly and as URDF means them.

The rewritten text has no visuals. Its meshes are OBJ files of the points of their convex hulls, which this package
writes. So PyBullet in the simulation's process reads only files of this package. The work, and a first load, is done in
a child process (`Workshop`): whatever crashes there refuses the robot.
"""

from __future__ import annotations

import copy
import hashlib
import os
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import NamedTuple
from xml.etree import ElementTree

from smartmesh_ros.errors import InputError
from smartmesh_ros.world.robots.description import Description, located, named_file, read_description
from smartmesh_ros.world.robots.dynamics import mend_inertias, normalise_axes, starts_of
from smartmesh_ros.world.robots.ignored import ignored_in
from smartmesh_ros.world.robots.meaning import Mimic, SurfaceDrive, mimics_of, surface_drives_of, with_massive_root
from smartmesh_ros.world.robots.quantities import check_quantities, scale_of
from smartmesh_ros.world.robots.workshop import WORKSHOP

# Children of links and joints that PyBullet reads; <contact> is its own.
_OF_LINKS = ("inertial", "collision", "contact")
_OF_JOINTS = ("parent", "child", "origin", "axis", "limit", "dynamics")
# Number of prepared robots to remember. A robot of a hundred meshes takes about a megabyte.
MOST_REMEMBERED = 100


class Mesh(NamedTuple):
    """A mesh of a robot: its file, the digest of its content, and its scale. ``name``: of the OBJ file made of it."""

    path: Path
    scale: tuple[float, float, float]
    digest: str

    @property
    def name(self) -> str:
        """File name that differs for each content and scale."""
        return hashlib.sha256(f"{self.digest}{self.scale}".encode()).hexdigest()[:32] + ".obj"


@dataclass(frozen=True, kw_only=True)
class PreparedRobot:
    """A robot for `BodyFactory`. ``given``: the URDF text or path as given. ``text``: what PyBullet loads, with
    ``meshes`` (one for each use) beside it, and once they are made ``files`` by name. ``collisions``: number of
    collision elements by link. ``mimics``: joints that follow others. ``notes``: what is taken otherwise than PyBullet
    would; ``warnings``: what its author likely did not mean. ``surfaces``: driven ones by name. ``starts``: positions
    of joints that do not start at zero [rad, m]."""

    given: str
    text: str
    meshes: tuple[Mesh, ...]
    collisions: Mapping[str, int]
    mimics: tuple[Mimic, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    surfaces: Mapping[str, SurfaceDrive] = field(default_factory=dict)
    starts: Mapping[str, float] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)


# The mesh files that the child made of robots, by their texts.
_remembered: OrderedDict[str, Mapping[str, bytes]] = OrderedDict()
_lock = Lock()


def prepare_robot(urdf: str | os.PathLike[str] | PreparedRobot) -> PreparedRobot:
    """Prepare a robot from its URDF text (starts with ``<``) or the path of its file, as of `expanded`; one that was
    prepared before is returned as it is. Raises `InputError` if the robot cannot be simulated.

    The first preparation of a robot takes a while (a child process starts, and reads the meshes); a robot of the same
    content is remembered. Threads may call this function.
    """
    if isinstance(urdf, PreparedRobot):
        return urdf
    if not isinstance(urdf, str | os.PathLike):
        raise InputError("urdf", f"the robot is of type {type(urdf).__name__}; pass the text or the path of a URDF")
    urdf = located(os.fspath(urdf))
    robot = _rewritten(urdf, read_description(urdf))
    with _lock:
        if robot.text not in _remembered:
            _remembered[robot.text] = WORKSHOP.make(robot)
        files = _remembered[robot.text]
        _remembered.move_to_end(robot.text)
        while len(_remembered) > MOST_REMEMBERED:
            _remembered.popitem(last=False)
    return replace(robot, files=files)


def _rewritten(urdf: str, robot: Description) -> PreparedRobot:
    """Return a robot whose text PyBullet can load once its meshes are made."""
    check_quantities(robot)
    normalise_axes(robot)
    mimics, starts = mimics_of(robot), starts_of(robot)
    starts |= {m.joint: m.multiplier * starts.get(m.leader, 0.0) + m.offset for m in mimics}
    note, warning = with_massive_root(robot)
    warnings = (mend_inertias(robot), warning, ignored_in(robot))
    gears = (
        f"joint {m.joint!r} follows {m.leader!r} ({m.multiplier:g} times, {m.offset:+g}) by a gear" for m in mimics
    )
    notes = (note, *gears)
    made = ElementTree.Element("robot", name=robot.robot.get("name") or "robot")
    meshes = []
    for tag, kept in (("link", _OF_LINKS), ("joint", _OF_JOINTS)):
        for element in robot.robot.findall(tag):
            new = ElementTree.SubElement(made, tag, element.attrib)
            new.extend(copy.deepcopy(child) for child in element if child.tag in kept)
    for collision in made.iter("collision"):
        collision.attrib.pop("concave", None)  # meshes collide as convex hulls
        for element in collision.iter("mesh"):
            path = named_file(element.get("filename", ""), robot.folder)
            mesh = Mesh(path, scale_of(element), _digest(path))
            meshes.append(mesh)
            element.attrib = {"filename": mesh.name}
    ElementTree.indent(made)  # PyBullet breaks lines longer than its buffer, even within a number
    return PreparedRobot(
        given=urdf, text=ElementTree.tostring(made, encoding="unicode"), meshes=tuple(meshes),
        collisions={name: len(robot.collisions(name)) for name in robot.links}, mimics=mimics,
        notes=tuple(filter(None, notes)), warnings=tuple(filter(None, warnings)),
        surfaces=surface_drives_of(robot), starts=starts,
    )  # fmt: skip


def _digest(path: Path) -> str:
    """Return a digest of a file's content and of its kind, which its suffix tells."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() + path.suffix.lower()
    except OSError as error:
        raise InputError("asset", f"collision mesh {str(path)!r} cannot be read: {error}") from None
