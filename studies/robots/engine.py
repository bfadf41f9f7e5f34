"""Interface of the engines that simulate robots."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from smartmesh_ros.scenes.moving import Scene
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.robots.description import is_text
from studies.engines.engine import GroundSetup, Simulation
from studies.robots.robot import Robot

# Time constant [s] of the servos that hold joints: the error shrinks by a tenth in a step of 1 / 240 s, which is
# PyBullet's default.
SERVO = 10.0 / 240.0
# Friction of every link against the ground.
FRICTION = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotSetup(GroundSetup):
    """Robots of one kind on a height map.

    ``text``: the `prepared` URDF. ``starts`` (N, 3) [m]: of the frames of their root links, all level. ``speed``
    [rad/s]: of the wheels, 0 = braked.
    """

    robot: Robot
    text: str
    starts: FloatArray
    speed: float = 0.0


def setup_of(robot: Robot, ground: Scene, starts: FloatArray, rate: float, speed: float) -> RobotSetup:
    """Return robots on a ground as it is at the beginning, for steps at a ``rate`` [Hz]."""
    x, y, _ = ground.geometry.origin
    return RobotSetup(
        robot=robot, text=prepared(robot.urdf), starts=starts, speed=speed, heights=ground.heights(0.0), origin=(x, y),
        resolution=ground.geometry.resolution, dt=1.0 / rate,
    )  # fmt: skip


class RobotEngine(Simulation):
    """Simulation of robots on moving ground in one engine.

    ``names``: of the links with collision shapes (L,), whose frames are those of the URDF. All joints of the robot's
    stance are servos of time constant `SERVO` and the robot's torque; its wheels keep their speed with the same torque;
    other joints turn freely. Links of robots do not collide with one another. Velocities are those of the centres of
    mass.
    """

    names: tuple[str, ...]
    # True if the engine collides cylinders as prisms of 32 sides.
    has_prisms: ClassVar[bool] = False

    @abstractmethod
    def hold(self, positions: Mapping[str, float]) -> None:
        """Set the positions [rad] that all robots' servos hold, by joint."""


def xyzw(wxyz: FloatArray) -> FloatArray:
    """Return quaternions (..., 4) whose scalar comes first with the scalar last."""
    return np.asarray(wxyz)[..., [1, 2, 3, 0]]


# Mass of links whose description gives none [kg], balls of 0.1 m. Loaders differ: PyBullet takes 1 kg, others nothing.
MASSLESS = 0.01
_INERTIAL = (
    f'<inertial><mass value="{MASSLESS:g}"/><inertia ixx="4e-05" iyy="4e-05" izz="4e-05" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>"
)
# What a file of husky has kept of its macros: the value of an environment variable, or what stands behind its name.
_OPTIONAL = re.compile(r"\$\(optenv \w+ ([^)]*)\)")


def prepared(urdf: str) -> str:
    """Return the text of a URDF file or text with what loaders agree about: links, joints and collision shapes.

    Paths of meshes are absolute. Pictures and extensions are left out. Links without a mass get a small one.
    """
    root = ET.fromstring(urdf) if is_text(urdf) else ET.parse(urdf).getroot()
    for part in list(root):
        if part.tag not in ("link", "joint"):
            root.remove(part)
    for link in root.iter("link"):
        for tag in ("visual", "contact"):
            for part in link.findall(tag):
                link.remove(part)
        if link.find("inertial") is None:
            link.append(ET.fromstring(_INERTIAL))
    for part in root.iter():
        for name, value in part.attrib.items():
            part.set(name, _OPTIONAL.sub(r"\1", value))
    folder = Path() if is_text(urdf) else Path(urdf).parent
    for mesh in root.iter("mesh"):
        mesh.set("filename", str((folder / mesh.attrib["filename"]).resolve()))
    return ET.tostring(root, encoding="unicode")
