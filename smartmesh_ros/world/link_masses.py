"""Masses of links that a URDF gives no inertia.

PyBullet gives each link without <inertial> a mass of 1 kg and moments of inertia of 1 kg m^2. For other loaders such a
link (a frame of a sensor or of a tool) has no mass.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from xml.etree import ElementTree

import pybullet as pb

# Mass of a link that needs one [kg], and its moments of inertia if no shape gives them [kg m^2].
NEEDED_MASS, NEEDED_INERTIA = 1.0, 0.01
_MOVING = (pb.JOINT_REVOLUTE, pb.JOINT_PRISMATIC, pb.JOINT_SPHERICAL, pb.JOINT_PLANAR)


class LinkMasses(NamedTuple):
    """Names of the links without <inertial>: those that have no mass now, and those that have `NEEDED_MASS`, because
    without it a joint would move no mass at all, or the root would be fixed to the world."""

    without: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()

    @property
    def note(self) -> str:
        """What to tell the user, empty if every link has an <inertial>."""
        parts = []
        if self.without:
            parts.append(f"links without <inertial> have no mass: {', '.join(self.without)}")
        if self.needed:
            parts.append(
                f"links without <inertial> weigh {NEEDED_MASS:g} kg each, because a joint or the root needs a mass to "
                f"move: {', '.join(self.needed)}; give them an <inertial>"
            )
        return "; ".join(parts)


def set_masses(client: Any, uid: int, urdf: str) -> LinkMasses:
    """Take the mass of links without <inertial>, by the ``urdf`` text that PyBullet loaded, and return their names."""
    links = ElementTree.fromstring(urdf).iterfind("link")
    bare = {link.get("name", "") for link in links if link.find("inertial") is None}
    joints = [client.getJointInfo(uid, index) for index in range(client.getNumJoints(uid))]
    names = [client.getBodyInfo(uid)[0].decode(), *(joint[12].decode() for joint in joints)]
    masses = [client.getDynamicsInfo(uid, index)[0] for index in range(-1, len(joints))]
    # Mass that moves with each link: its own and that of the links below it, which come later. Root first.
    moved = [0.0 if name in bare else mass for name, mass in zip(names, masses, strict=True)]
    for index in reversed(range(len(joints))):
        moved[joints[index][16] + 1] += moved[index + 1]
    without, needed = [], []
    for index, joint in enumerate(joints):
        name = names[index + 1]
        if name not in bare:
            continue
        if joint[2] in _MOVING and not moved[index + 1]:
            needed.append(name)
            _set_needed_mass(client, uid, index)
        else:
            without.append(name)
            client.changeDynamics(uid, index, mass=0.0)
    if names[0] in bare and masses[0]:  # PyBullet gives a root called world no mass
        needed.append(names[0])
    return LinkMasses(tuple(without), tuple(needed))


def _set_needed_mass(client: Any, uid: int, index: int) -> None:
    if client.getCollisionShapeData(uid, index):
        client.changeDynamics(uid, index, mass=NEEDED_MASS)  # with the inertia of the shapes
    else:
        client.changeDynamics(uid, index, mass=NEEDED_MASS, localInertiaDiagonal=[NEEDED_INERTIA] * 3)
