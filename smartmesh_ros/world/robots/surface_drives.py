"""Driven surfaces of a robot, such as its tracks: an element of this package in robot descriptions.

``<surface_drive name="left_track" link="left_track_link"><axis xyz="0 1 0"/><limit velocity="1.5"/></surface_drive>``
stands beside the links and joints. Other loaders skip what they do not know.
"""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree import ElementTree

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.belt import LEAST_AXIS
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.world.robots.description import Description
from smartmesh_ros.world.robots.quantities import numbers

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
    if not 0.0 < limit <= FASTEST:
        raise InputError("urdf", f"the limit of {what} is {limit:g} m/s; it must be above zero, to {FASTEST:g}")
    return SurfaceDrive(link, (x, y, z), limit)


def _only(element: ElementTree.Element, tag: str, what: str) -> ElementTree.Element:
    found = element.findall(tag)
    if len(found) != 1:
        raise InputError("urdf", f"{what} has {len(found)} elements <{tag}>; it needs one")
    return found[0]
