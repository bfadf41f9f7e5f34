"""Numbers that PyBullet and URDF understand differently: moments of inertia, axes, and limits that exclude zero."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np

from smartmesh_ros.world.robots.description import Description
from smartmesh_ros.world.robots.quantities import LIMITED, limits_of, mass_of, number_of, vector_of

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
# Radius of gyration of a link that has a mass and no moment of inertia [m].
POINT_GYRATION = 0.01
# Share of the largest moment by which the sum of the two others is larger than it, and by which it may fall short
# without a note, because descriptions are rounded.
ROUNDING, NOTED = 1e-6, 1e-3


def mend_inertias(robot: Description) -> str:
    """Raise moments of inertia that no body can have, in place; return a note, empty if there is nothing to tell.

    PyBullet replaces them by zero. A joint that moves only such links would be locked, and a root at no place.
    """
    raised = [name for name, link in robot.links.items() if mass_of(link) and _mend_inertia(link)]
    if not raised:
        return ""
    return f"no body has the moments of inertia of these links, of which the smaller are raised: {', '.join(raised)}"


def _mend_inertia(link: ElementTree.Element) -> bool:
    """Make the principal moments of a link possible; return True if they were not, by more than rounding."""
    [inertia] = link.findall("inertial/inertia")[:1]
    xx, yy, zz, xy, xz, yz = (number_of(inertia, key, 0.0) for key in _MOMENTS)
    moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least, middle, most = moments.tolist()
    short = most - middle - max(least, 0.0)
    if least >= 0.0 and most > 0.0 and short <= -ROUNDING * most * (xy != 0.0 or xz != 0.0 or yz != 0.0):
        return False
    if most <= 0.0:
        made = np.eye(3) * POINT_GYRATION**2 * (mass_of(link) or 0.0)
    else:
        lower = np.maximum(moments[:2], 0.0)
        lower += 0.5 * max((1.0 + ROUNDING) * most - float(lower.sum()), 0.0)
        made = axes @ np.diag([*lower, most]) @ axes.T
    for key, value in zip(_MOMENTS, made[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].tolist(), strict=True):
        inertia.set(key, repr(value))
    return bool(least < 0.0 or most <= 0.0 or short > NOTED * most)


def normalise_axes(robot: Description) -> None:
    """Give the axes of joints unit length, in place: PyBullet multiplies a joint's motion by the length."""
    for joint in robot.joints:
        for axis in joint.element.findall("axis"):
            x, y, z = vector_of(axis, "xyz", 1.0)
            if length := math.hypot(x, y, z):
                axis.set("xyz", f"{x / length!r} {y / length!r} {z / length!r}")


def starts_of(robot: Description) -> dict[str, float]:
    """Return the start positions of joints whose limits exclude zero [rad, m]: the nearest limit."""
    starts = {}
    for joint in robot.joints:
        for limit in joint.element.findall("limit")[:1] if joint.kind in LIMITED else ():
            low, high = limits_of(limit)
            if low <= high and not low <= 0.0 <= high:
                starts[joint.name] = low if low > 0.0 else high
    return starts
