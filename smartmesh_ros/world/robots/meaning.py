"""Elements of a description that PyBullet's loader ignores: roots without mass, joints that mimic others, and driven
surfaces, such as tracks.

The last are an element of this package, which other loaders skip:
``<surface_drive name="left_track" link="left_track_link"><axis xyz="0 1 0"/><limit velocity="1.5"/></surface_drive>``
stands beside the links and joints.
"""

from __future__ import annotations

import math
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple
from xml.etree import ElementTree

from smartmesh_ros.errors import InputError, require
from smartmesh_ros.ground.followers import LEAST_AXIS
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.world.robots.description import Description
from smartmesh_ros.world.robots.quantities import MOVABLE, mass_of, number_of, numbers

# Root link that stands for the world: what is fixed to it does not move. A convention of Gazebo that PyBullet follows.
WORLD = "world"
# Share of a link's mass and inertia that a root without mass is given. A larger share moves the robot's centre of mass
# by more (by this share of their distance), a smaller one makes the equations of motion ill-conditioned.
ROOT_SHARE = 1e-3
# Least radius of gyration of such a root [m]; PyBullet cannot turn a root without inertia.
LEAST_GYRATION = 0.01


class Mimic(NamedTuple):
    """A joint whose position is ``multiplier`` times that of the joint ``leader``, plus ``offset`` [rad, m]."""

    joint: str
    leader: str
    multiplier: float
    offset: float


def mimics_of(robot: Description) -> tuple[Mimic, ...]:
    """Return the joints that mimic others; fixed ones do not. Raises `InputError` if one mimics a joint that cannot
    move or is not there."""
    movable = {joint.name for joint in robot.joints if joint.kind in MOVABLE}
    found = {}
    for joint in robot.joints:
        for element in joint.element.findall("mimic")[:1] if joint.kind != "fixed" else ():
            leader = element.get("joint", "")
            if joint.name not in movable or leader not in movable or leader == joint.name:
                raise InputError(
                    "urdf", f"joint {joint.name!r} mimics {leader!r}; both must be distinct revolute, continuous or "
                    "prismatic joints of the robot"
                )  # fmt: skip
            factors = number_of(element, "multiplier", 1.0), number_of(element, "offset", 0.0)
            found[joint.name] = Mimic(joint.name, leader, *factors)
    try:
        TopologicalSorter({mimic.joint: [mimic.leader] for mimic in found.values()}).prepare()
    except CycleError as error:
        raise InputError("urdf", f"joint {error.args[1][0]!r} mimics itself by way of other joints") from None
    return tuple(found.values())


def with_massive_root(robot: Description) -> tuple[str, str]:
    """Make one rigid body of a root without mass and a link that fixed joints hold to it; return a note and a warning
    about it, empty if there is none.

    PyBullet keeps a root without mass in place for ever. In URDF such a root (base_footprint) is only a frame of the
    rigid body that its fixed joints make of it. Names and frames of the links stay.
    """
    root = robot.links[robot.root]
    if mass_of(root):
        return "", ""
    if robot.root == WORLD:
        return "root link 'world': the robot is fixed to the ground's frame and does not move", ""
    for link in robot.fixed_to_root():
        if mass := mass_of(robot.links[link]):
            _share_mass(root, robot.links[link])
            merged = f"root link {robot.root!r} has no mass and is merged with link {link!r} ({mass:g} kg), fixed to it"
            return merged, ""
    if mass_of(root) is None:
        return "", ""
    zero = f"root link {robot.root!r} has a mass of 0 and no link with mass is fixed to it"
    return "", f"{zero}: the robot's root does not move"


def _share_mass(root: ElementTree.Element, link: ElementTree.Element) -> None:
    """Give the root a small share of the mass and inertia of a link that is fixed to it. The root's centre of mass is
    the origin of its frame, and its inertia that of a ball, so that PyBullet's pose of it is the pose of its frame."""
    for inertial in root.findall("inertial"):
        root.remove(inertial)
    mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
    assert mass is not None and inertia is not None
    whole = number_of(mass, "value", 0.0)
    moment = sum(number_of(inertia, key, 0.0) for key in ("ixx", "iyy", "izz")) / 3.0
    mass.set("value", repr((1.0 - ROOT_SHARE) * whole))
    made = ElementTree.SubElement(root, "inertial")
    ElementTree.SubElement(made, "mass", value=repr(ROOT_SHARE * whole))
    ball = repr(ROOT_SHARE * max(moment, LEAST_GYRATION**2 * whole))
    ElementTree.SubElement(made, "inertia", ixx=ball, iyy=ball, izz=ball, ixy="0", ixz="0", iyz="0")


TAG = "surface_drive"


class SurfaceDrive(NamedTuple):
    """Drive of a link's surface: about an ``axis`` in the frame of the ``link``, at up to ``limit`` [m/s]."""

    link: str
    axis: Vector
    limit: float

    def within(self, speed: float) -> float:
        """Return the speed [m/s] at which the surface moves for a commanded one: as fast as it can at most."""
        return min(max(speed, -self.limit), self.limit)


def surface_drives_of(robot: Description) -> dict[str, SurfaceDrive]:
    """Return the driven surfaces of a robot by name. Raises `InputError` if one cannot be driven, or is ambiguous."""
    found: dict[str, SurfaceDrive] = {}
    for element in robot.robot.findall(TAG):
        name, drive = element.get("name", ""), _drive(element, robot)
        if not name:
            raise InputError("urdf", f"a {TAG} of link {drive.link!r} has no name")
        if name in found or any(joint.name == name for joint in robot.joints):
            raise InputError("urdf", f"{TAG} {name!r} has the name of another or of a joint; each needs its own")
        if drive.link in {other.link for other in found.values()}:
            raise InputError("urdf", f"link {drive.link!r} has two of {TAG}; a link has one surface")
        found[name] = drive
    return found


def _drive(element: ElementTree.Element, robot: Description) -> SurfaceDrive:
    what, link = f"{TAG} {element.get('name', '')!r}", element.get("link", "")
    if link not in robot.links:
        raise InputError("urdf", f"the link of {what} is {link!r}, which does not exist")
    if not robot.collisions(link):
        raise InputError("urdf", f"link {link!r} of {what} has no collision shape, so that it touches nothing")
    x, y, z = numbers(_only(element, "axis", what), "xyz", what, 3)
    [limit] = numbers(_only(element, "limit", what), "velocity", what, 1)
    if not LEAST_AXIS <= math.hypot(x, y, z) <= FARTHEST_BODY:
        raise InputError("urdf", f"the axis of {what} is ({x:g}, {y:g}, {z:g}), which is zero or has no length")
    require(0.0 < limit <= FASTEST, "urdf", f"the limit of {what}", limit, f"above zero, to {FASTEST:g} m/s")
    return SurfaceDrive(link, (x, y, z), limit)


def _only(element: ElementTree.Element, tag: str, what: str) -> ElementTree.Element:
    found = element.findall(tag)
    if len(found) != 1:
        raise InputError("urdf", f"{what} has {len(found)} elements <{tag}>; it needs one")
    return found[0]
