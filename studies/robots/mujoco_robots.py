"""Robots in MuJoCo: its own URDF loader, and one height field of the whole map, whose data are written in place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.scenes.moving import FloatGrid
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.engine import Contacts
from studies.engines.mujoco_hfield import mujoco_contacts
from studies.robots.engine import FRICTION, SERVO, Links, RobotEngine, RobotSetup, xyzw
from studies.robots.urdf import root_link

# Memory for the contacts of one robot [bytes].
ARENA = 8 << 20
# Bits of the robots and of the ground: robots touch the ground, and not one another.
ROBOT, GROUND = 1, 2


@dataclass(frozen=True, kw_only=True)
class MujocoRobotOptions:
    """``time_constant`` [s]: of the contacts (MuJoCo's solref), None = two steps, the tightest. ``lowest``, ``highest``
    [m]: range of the ground."""

    time_constant: float | None = None
    lowest: float = -2.0
    highest: float = 2.0


class MujocoRobots(RobotEngine):
    """The ground has no velocity in contacts. Speculative contacts are off: they do nothing on height fields.

    Servos are constraints, as PyBullet's are, but have no limit of torque; driven wheels follow the angle of their
    speed.
    """

    def __init__(self, setup: RobotSetup, options: MujocoRobotOptions | None = None) -> None:
        self._options = chosen = options or MujocoRobotOptions()
        rows, columns = setup.heights.shape
        width, length = (columns - 1) * setup.geometry.resolution, (rows - 1) * setup.geometry.resolution
        x, y, _ = setup.geometry.origin
        spec = mujoco.MjSpec()
        spec.option.timestep = setup.dt
        spec.memory = ARENA * (1 + len(setup.starts))
        spec.add_hfield(
            name="ground", nrow=rows, ncol=columns, userdata=np.zeros(rows * columns, np.float32),
            size=[0.5 * width, 0.5 * length, chosen.highest - chosen.lowest, 1.0],
        )  # fmt: skip
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", condim=3, contype=GROUND, conaffinity=ROBOT,
            pos=[x + 0.5 * width, y + 0.5 * length, chosen.lowest],
        )  # fmt: skip
        robot = setup.robot
        self._prefixes = [f"r{index}/" for index in range(len(setup.starts))]
        self._root = root_link(setup.text)
        for prefix in self._prefixes:
            spec.attach(self._loaded(setup), prefix=prefix, frame=spec.worldbody.add_frame())
            for joint in (*robot.stance, *robot.wheels):
                _constrain(spec, f"{prefix}{joint}")
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._heights = self.model.hfield_data.reshape(rows, columns)
        self._note_links()
        for prefix, start in zip(self._prefixes, setup.starts, strict=True):
            self._place(prefix, start, robot.stance)
        self.hold(robot.stance)
        self._wheels = [self.model.equality(f"{one}{wheel}").id for one in self._prefixes for wheel in robot.wheels]
        self._speed = setup.speed
        self.set_ground(setup.heights)
        mujoco.mj_forward(self.model, self.data)

    def _loaded(self, setup: RobotSetup) -> mujoco.MjSpec:
        """Return one robot as MuJoCo's loader reads it, on a floating joint."""
        floating = (
            '<mujoco><compiler fusestatic="false" strippath="false"/></mujoco><link name="world"/>'
            f'<joint name="floating" type="floating"><parent link="world"/><child link="{self._root}"/></joint>'
        )
        spec = mujoco.MjSpec.from_string(setup.text.replace("<link ", f"{floating}<link ", 1))
        time_constant = self._options.time_constant or 2.0 * setup.dt
        for geom in spec.geoms:
            # Priority: the robot's friction and contact hold, not a mixture with the ground's.
            geom.priority, geom.condim, geom.friction = 1, 3, [FRICTION, 0.0, 0.0]
            geom.contype, geom.conaffinity = ROBOT, GROUND
            geom.solref = [time_constant, 1.0]
        return spec

    def _note_links(self) -> None:
        model = self.model
        with_shapes = sorted(set(model.geom_bodyid.tolist()) - {0})
        first = [model.body(body).name for body in with_shapes]
        prefix = self._prefixes[0]
        self.names = tuple(name.removeprefix(prefix) for name in first if name.startswith(prefix))
        self._bodies = np.array([[model.body(f"{one}{name}").id for name in self.names] for one in self._prefixes])
        self._roots = [model.body(f"{prefix}{self._root}").id for prefix in self._prefixes]

    def _place(self, prefix: str, start: FloatArray, stance: Mapping[str, float]) -> None:
        floating = self.model.joint(f"{prefix}floating").qposadr[0]
        self.data.qpos[floating : floating + 7] = [*start, 1.0, 0.0, 0.0, 0.0]
        for joint, position in stance.items():
            self.data.qpos[self.model.joint(f"{prefix}{joint}").qposadr[0]] = position

    def set_ground(self, heights: FloatGrid) -> None:
        low, high = self._options.lowest, self._options.highest
        if not (heights.min() >= low and heights.max() <= high):
            raise InputError("height", f"heights leave {low} to {high} m; build the engine with a wider range")
        np.divide(heights - low, high - low, out=self._heights, casting="unsafe")

    def hold(self, positions: Mapping[str, float]) -> None:
        for prefix in self._prefixes:
            for joint, position in positions.items():
                self.model.eq_data[self.model.equality(f"{prefix}{joint}").id, 0] = position

    def step(self) -> None:
        if self._speed:
            self.model.eq_data[self._wheels, 0] = self._speed * self.data.time
        mujoco.mj_step(self.model, self.data)

    def links(self) -> Links:
        mujoco.mj_kinematics(self.model, self.data)
        return Links(self.data.xpos[self._bodies].copy(), xyzw(self.data.xquat[self._bodies]))

    def velocities(self) -> FloatArray:
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)
        mujoco.mj_subtreeVel(self.model, self.data)
        return np.asarray(self.data.subtree_linvel[self._roots]).copy()

    def contacts(self) -> Contacts:
        parts = {body: robot for robot, bodies in enumerate(self._bodies.tolist()) for body in bodies}
        return mujoco_contacts(self.model, self.data, parts)

    def close(self) -> None:
        """Nothing is left open."""


def _constrain(spec: mujoco.MjSpec, joint: str) -> None:
    """Add a constraint that holds a joint at a position. An actuator as stiff would make robots tremble: MuJoCo solves
    contacts without the damping that its integrator adds for actuators."""
    constraint = spec.add_equality(name=joint, type=mujoco.mjtEq.mjEQ_JOINT, name1=joint)
    constraint.objtype = mujoco.mjtObj.mjOBJ_JOINT
    constraint.data = np.zeros((len(constraint.data), 1))
    # Overdamped: two time constants, which together are that of a servo. A tighter one would tremble against contacts.
    constraint.solref = [0.25 * SERVO, math.sqrt(2.0)]
