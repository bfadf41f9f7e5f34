"""Robots and the tables of their joints, the interface of the engines that simulate them, and the scenes of the study:
robots on grounds that rest or move, on grids of three spacings."""

import math
import re
import xml.etree.ElementTree as ET
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import pybullet_data

from smartmesh_ros import GridGeometry
from smartmesh_ros.scenes.moving import FloatGrid, Scene, Wave
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.distance import Surface
from smartmesh_ros.world.robots.description import is_text
from studies.engines.engine import GroundSetup, Simulation
from studies.robots.urdf import link_of, rover

DATA = Path(pybullet_data.getDataPath())


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot and how it stands.

    ``urdf``: path or text of its description. ``height`` [m]: of the centre of mass of its root link above level ground
    when it stands. ``stance``: joints that are held at a position [rad]. ``wheels``: joints that are braked at rest,
    and driven at ``speed`` [rad/s] otherwise. ``torque`` [Nm]: limit of both. ``reach`` [m]: radius around its middle
    that it stands on.
    """

    name: str
    urdf: str
    height: float
    stance: Mapping[str, float] = field(default_factory=dict)
    wheels: tuple[str, ...] = ()
    speed: float = 0.0
    torque: float = 100.0
    reach: float = 0.4


# Phase of each leg of laikago as a share of the period [-]: the legs of a diagonal swing together.
PHASES = {"FR": 0.0, "FL": 0.5, "RR": 0.5, "RL": 0.0}
# Bend of the knees with which laikago's feet stand below its hips [rad].
LAIKAGO_KNEE = -0.5
# A trot of laikago: period of a step of each leg [s], swing of the hips forwards and backwards [rad], lift of the knees
# while their leg swings forwards [rad], and rate of the table's rows [Hz].
PERIOD, SWING, LIFT, TROT_RATE = 0.4, 0.12, 0.35, 60.0


def laikago_leg(leg: str, hip: float, knee: float) -> Mapping[str, float]:
    """Return the positions [rad] of a leg's joints."""
    names = ("hip_motor_2_chassis", "upper_leg_2_hip_motor", "lower_leg_2_upper_leg")
    return {f"{leg}_{name}_joint": position for name, position in zip(names, (0.0, hip, knee), strict=True)}


def trot_at(time: float) -> Mapping[str, float]:
    """Return the joint positions [rad] of the row of a trot's table at a ``time`` [s]. A leg swings forwards in the
    first half of the period, its knee bent, and pushes the ground backwards in the second."""
    rows, found = round(PERIOD * TROT_RATE), dict[str, float]()
    share = int(time * TROT_RATE + 1e-6) % rows / rows
    for leg, phase in PHASES.items():
        angle = 2.0 * math.pi * (share + phase)
        found |= laikago_leg(leg, SWING * math.cos(angle), LAIKAGO_KNEE - LIFT * max(math.sin(angle), 0.0))
    return found


WHEELS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
_STANCE = {joint: position for leg in PHASES for joint, position in laikago_leg(leg, 0.0, LAIKAGO_KNEE).items()}
ROVER = Robot(name="rover", urdf=rover(WHEELS), height=0.12, wheels=WHEELS, speed=5.0)
HUSKY = Robot(name="husky", urdf=f"{DATA}/husky/husky.urdf", height=0.0, wheels=WHEELS, speed=5.0, reach=0.5)
LAIKAGO = Robot(name="laikago", urdf=f"{DATA}/laikago/laikago_toes_zup.urdf", height=0.497, stance=_STANCE)
RACECAR = Robot(
    name="racecar", urdf=f"{DATA}/racecar/racecar.urdf", height=0.0, torque=2.0, reach=0.3,
    stance={"left_steering_hinge_joint": 0.0, "right_steering_hinge_joint": 0.0},
    # The axles point to the right: positive speeds drive backwards.
    speed=-10.0, wheels=tuple(f"{side}_{end}_wheel_joint" for end in ("rear", "front") for side in ("left", "right")),
)  # fmt: skip


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


# Mass of links whose description gives none [kg], balls of 0.1 m. Loaders differ: PyBullet takes 1 kg, others nothing.
MASSLESS = 0.01
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
            link.append(ET.fromstring(link_of("massless", MASSLESS, (4e-5, 4e-5, 4e-5)))[0])
    for part in root.iter():
        for name, value in part.attrib.items():
            part.set(name, _OPTIONAL.sub(r"\1", value))
    folder = Path() if is_text(urdf) else Path(urdf).parent
    for mesh in root.iter("mesh"):
        mesh.set("filename", str((folder / mesh.attrib["filename"]).resolve()))
    return ET.tostring(root, encoding="unicode")


# A wave whose ground moves at up to 0.2 m/s and 0.8 m/s^2, upwards and downwards.
HEAVING = Wave(amplitude=0.05, number=1.0, frequency=4.0)
STILL = Wave(amplitude=0.0)


class RoughHills(Scene):
    """Hills of a height [m] with independent normally distributed noise of 1 cm at every sample, and a ``wave`` along x
    that carries all of it up and down."""

    def __init__(self, geometry: GridGeometry, wave: Wave, hills: float = 0.1) -> None:
        super().__init__(geometry)
        self.wave = wave
        noise = np.random.default_rng(0).normal(0.0, 0.01, (geometry.rows, geometry.columns))
        self._still: FloatGrid = (hills * np.sin(1.5 * self.x) * np.cos(1.1 * self.y) + noise).astype(np.float32)

    def heights(self, time: float) -> FloatGrid:
        wave = self.wave
        if wave.amplitude == 0.0:
            return self._still
        heave = np.float32(wave.amplitude) * np.sin(wave.number * self.x - np.float32(wave.frequency * time))
        heights: FloatGrid = self._still + heave.astype(np.float32)
        return heights


# Side of the map [m], and where the robots start: side by side, with room to move along x [m].
SIDE = 6.0
STARTS = ((-1.2, -1.8), (-1.2, 0.0), (-1.2, 1.8))
# Height of the hills [m]: legged robots that only hold their joints stay on their feet.
HILLS = 0.05
# Gap below the lowest point of a robot that starts over the highest ground around it [m].
GAP = 0.005

Motion = Literal["rest", "wave", "maps"]
# By motion of the ground: rate of the maps [Hz], and words.
MOTIONS: dict[Motion, tuple[float, str]] = {
    "rest": (0.0, "ground at rest"),
    "wave": (60.0, "heaving ground, maps at 60 Hz"),
    "maps": (20.0, "heaving ground, maps at 20 Hz"),
}


@dataclass(frozen=True, kw_only=True)
class RobotScene:
    """Three robots on rough hills, whose root links start at ``starts`` (N, 3) [m]. ``map_rate`` [Hz]: 0 = one map.
    ``speed`` [rad/s]: of the wheels. ``trot``: they walk, else they stand, or drive where the ground moves. ``quick``:
    part of the quick run. ``duration``, and ``settle`` that is not measured [s]. ``samples``: measurements in a second
    [Hz], no multiple of the rate of the maps, so that they see maps of every age."""

    name: str
    title: str
    robot: Robot
    ground: RoughHills
    starts: FloatArray
    map_rate: float
    speed: float
    trot: bool = False
    quick: bool = False
    duration: float = 2.0
    settle: float = 1.0
    samples: float = 30.0

    def surface(self, time: float) -> Surface:
        """Return the main mesh at ``time`` [s]."""
        return Surface(self.ground.geometry, np.asarray(self.ground.heights(time), np.float64))

    def joints(self, time: float) -> Mapping[str, float]:
        """Return the positions [rad] that the servos hold at ``time`` [s]."""
        return trot_at(time) if self.trot else self.robot.stance


def robot_scene(robot: Robot, motion: Motion, resolution: float, *, trot: bool = False) -> RobotScene:
    """Return a scene on a map of a ``resolution`` [m]."""
    map_rate, words = MOTIONS[motion]
    doing, cells = f"trotting {robot.name}" if trot else robot.name, f"{100.0 * resolution:.0f}"
    side = round(SIDE / resolution) + 1
    corner = (-0.5 * SIDE, -0.5 * SIDE, 0.0)
    geometry = GridGeometry(rows=side, columns=side, resolution=resolution, origin=corner)
    ground = RoughHills(geometry, HEAVING if map_rate else STILL, hills=HILLS)
    heights, starts = ground.heights(0.0).astype(np.float64), []
    for x, y in STARTS:
        near = np.hypot(ground.x - x, ground.y - y) <= max(robot.reach, resolution)
        starts.append((x, y, heights[near].max() + robot.height + GAP))
    return RobotScene(
        name=f"{doing.replace(' ', '_')}_{motion}_{cells}cm", title=f"{doing}, {words}, {cells} cm grid", robot=robot,
        ground=ground, starts=np.array(starts), map_rate=map_rate, speed=robot.speed if map_rate else 0.0, trot=trot,
        quick=(robot, motion, resolution) in ((HUSKY, "rest", 0.1), (LAIKAGO, "maps", 0.1)),
    )  # fmt: skip


def scenes() -> list[RobotScene]:
    """Return all scenes."""
    grids: dict[Motion, tuple[float, ...]] = {"rest": (0.04, 0.1, 0.25), "wave": (0.1,), "maps": (0.04, 0.1, 0.25)}
    return [
        robot_scene(robot, motion, resolution, trot=trot)
        for robot, trot in ((ROVER, False), (HUSKY, False), (RACECAR, False), (LAIKAGO, False), (LAIKAGO, True))
        for motion, spacings in grids.items()
        for resolution in spacings
    ]
