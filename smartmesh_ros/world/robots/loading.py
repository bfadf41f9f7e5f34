"""Prepared robots into PyBullet, the masses of links that a URDF gives no inertia, and the damping of joints.

PyBullet gives each link without <inertial> a mass of 1 kg and moments of inertia of 1 kg m^2. For other loaders such a
link (a frame of a sensor or of a tool) has no mass.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from threading import Lock
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet as pb

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.body_shapes import link_names
from smartmesh_ros.world.robots.meaning import Mimic
from smartmesh_ros.world.robots.prepared import PreparedRobot
from smartmesh_ros.world.robots.workshop import robots_folder

# Largest effort of a mimic joint's gear [Nm, N], beyond that of any robot's drive.
STRONGEST_GEAR = 1e5
# Ratio of a gear instead of zero, which PyBullet ignores.
TINY_RATIO = 1e-12
# Share of a gear's error that each step corrects.
GEAR_ERP = 0.2
# Highest velocity of joints to which PyBullet limits every robot by itself [rad/s, m/s].
PYBULLETS_FASTEST = 100.0


# Threads share the files of robots.
_lock = Lock()


def load_robot(client: Any, robot: PreparedRobot, flags: int) -> int:
    """Load a robot at the origin by ``loadURDF``, and return its PyBullet body. Raises `InputError`."""
    text = robot.text.encode()
    urdf = f"{hashlib.sha256(text).hexdigest()[:32]}.urdf"
    try:
        with _lock:
            folder = Path(robots_folder().name)
            folder.mkdir(exist_ok=True)  # a cleaner of temporary files may have removed it
            # PyBullet remembers OBJ files by name; these names differ with the content.
            for name, data in {**robot.files, urdf: text}.items():
                if not (folder / name).exists():
                    unfinished = folder / f"{name}.part"  # a file that could not be written whole is not taken for one
                    unfinished.write_bytes(data)
                    unfinished.rename(folder / name)
        return int(client.loadURDF(str(folder / urdf), flags=flags))
    except (pb.error, OSError) as error:
        raise InputError("urdf", f"the URDF does not load ({error}); check it with check_urdf") from None


def couple_joints(client: Any, uid: int, joints: dict[str, int], mimics: Iterable[Mimic]) -> None:
    """Couple joints that mimic others by gears, which PyBullet removes with the body."""
    for mimic in mimics:
        gear = client.createConstraint(
            uid, joints[mimic.joint], uid, joints[mimic.leader], pb.JOINT_GEAR, (0, 0, 1), (0, 0, 0), (0, 0, 0)
        )
        client.changeConstraint(
            gear, gearRatio=-mimic.multiplier or -TINY_RATIO, relativePositionTarget=mimic.offset, erp=GEAR_ERP,
            maxForce=STRONGEST_GEAR,
        )  # fmt: skip


# Mass of a link that needs one [kg], and its moments of inertia if no shape gives them [kg m^2].
NEEDED_MASS, NEEDED_INERTIA = 1.0, 0.01
_MOVING = (pb.JOINT_REVOLUTE, pb.JOINT_PRISMATIC, pb.JOINT_SPHERICAL, pb.JOINT_PLANAR)


def set_masses(client: Any, uid: int, urdf: str) -> tuple[str, str]:
    """Take the mass of links without <inertial>, by the ``urdf`` text that PyBullet loaded, and return a note and a
    warning about them, empty if there is none. Links keep `NEEDED_MASS` if without it a joint would move no mass at
    all, or the root would be fixed to the world."""
    links = ElementTree.fromstring(urdf).iterfind("link")
    bare = {link.get("name", "") for link in links if link.find("inertial") is None}
    joints = [client.getJointInfo(uid, index) for index in range(client.getNumJoints(uid))]
    names = link_names(client, uid)
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
            # With the inertia of the shapes, if there are any.
            moments = {} if client.getCollisionShapeData(uid, index) else {"localInertiaDiagonal": [NEEDED_INERTIA] * 3}
            client.changeDynamics(uid, index, mass=NEEDED_MASS, **moments)
        else:
            without.append(name)
            client.changeDynamics(uid, index, mass=0.0)
    if names[0] in bare and masses[0]:  # PyBullet gives a root called world no mass
        needed.append(names[0])
    note = f"links without <inertial> have no mass: {', '.join(without)}" if without else ""
    if not needed:
        return note, ""
    return note, (
        f"links without <inertial> weigh {NEEDED_MASS:g} kg each, because a joint or the root needs a mass to "
        f"move: {', '.join(needed)}; give them an <inertial>"
    )


def damp_joints(client: Any, uid: int, damping: Mapping[int, float], dt: float) -> dict[int, float]:
    """Give joints, by their indices, the ``damping`` of the URDF [Nms/rad, Ns/m], or as much of it as steps of ``dt``
    [s] bear in the present posture, once all masses are set; return the shares that joints have of theirs.

    PyBullet applies damping by the velocity before a step, which diverges if that takes more than twice the velocity. A
    joint that has c / (1 + k) instead of c, which takes k of its velocity, slows down as by implicit integration.
    Joints that move the same links act on each other by the correlation of their mobilities.
    """
    damped = [index for index, value in damping.items() if value]
    joints = [client.getJointInfo(uid, index) for index in range(client.getNumJoints(uid)) if damped]
    moving = [joint[0] for joint in joints if joint[2] != pb.JOINT_FIXED]
    if not damped or {joints[index][2] for index in moving} - {pb.JOINT_REVOLUTE, pb.JOINT_PRISMATIC}:
        return {}  # PyBullet has no mass matrix for other joints
    try:
        inertias = client.calculateMassMatrix(uid, [client.getJointState(uid, index)[0] for index in moving])
    except pb.error:  # more joints than PyBullet returns states of
        return {}
    rows = [moving.index(index) - len(moving) for index in damped]
    mobilities = np.linalg.inv(inertias)[np.ix_(rows, rows)]
    own = mobilities.diagonal()
    together = np.abs(mobilities / np.sqrt(np.outer(own, own))).sum(axis=1).max()
    given = np.array([damping[index] for index in damped])
    shares = 1.0 / (1.0 + dt * together * own * given)
    for index, value in zip(damped, (shares * given).tolist(), strict=True):
        client.changeDynamics(uid, index, jointDamping=value)
    return dict(zip(damped, shares.tolist(), strict=True))
