"""Robots in MuJoCo: its own URDF loader, on one height field of the whole map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.robots.description import read_description
from studies.engines.engine import Contacts, Links
from studies.engines.mujoco_hfield import BODY, GROUND, MujocoGround
from studies.robots.engine import FRICTION, SERVO, RobotEngine, RobotSetup, xyzw


class MujocoRobots(MujocoGround, RobotEngine):
    """Speculative contacts are off: they do nothing on height fields.

    Servos are constraints, as PyBullet's are, but have no limit of torque; driven wheels follow the angle of their
    speed.
    """

    reach: ClassVar[float] = 2.0

    def __init__(self, setup: RobotSetup, **options: Any) -> None:
        super().__init__(setup, (1 + len(setup.starts)) << 23, **options)
        robot, spec = setup.robot, self.spec
        self._prefixes = [f"r{index}/" for index in range(len(setup.starts))]
        self._root = read_description(setup.text).root
        for prefix in self._prefixes:
            spec.attach(self._loaded(setup), prefix=prefix, frame=spec.worldbody.add_frame())
            for joint in (*robot.stance, *robot.wheels):
                _constrain(spec, f"{prefix}{joint}")
        self.compile()
        self._note_links()
        for prefix, start in zip(self._prefixes, setup.starts, strict=True):
            self._place(prefix, start, robot.stance)
        self.hold(robot.stance)
        self._wheels = [self.model.equality(f"{one}{wheel}").id for one in self._prefixes for wheel in robot.wheels]
        self._speed = setup.speed
        self.set_ground(self.ready(setup.heights))
        mujoco.mj_forward(self.model, self.data)

    def _loaded(self, setup: RobotSetup) -> mujoco.MjSpec:
        """Return one robot as MuJoCo's loader reads it, on a floating joint."""
        floating = (
            '<mujoco><compiler fusestatic="false" strippath="false"/></mujoco><link name="world"/>'
            f'<joint name="floating" type="floating"><parent link="world"/><child link="{self._root}"/></joint>'
        )
        spec = mujoco.MjSpec.from_string(setup.text.replace("<link ", f"{floating}<link ", 1))
        for geom in spec.geoms:
            self.touch(geom, FRICTION)
            geom.contype, geom.conaffinity = BODY, GROUND  # robots do not touch one another
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
        return self.contacts_of({body: robot for robot, bodies in enumerate(self._bodies.tolist()) for body in bodies})


def _constrain(spec: mujoco.MjSpec, joint: str) -> None:
    """Add a constraint that holds a joint at a position. An actuator as stiff would make robots tremble: MuJoCo solves
    contacts without the damping that its integrator adds for actuators."""
    constraint = spec.add_equality(name=joint, type=mujoco.mjtEq.mjEQ_JOINT, name1=joint)
    constraint.objtype = mujoco.mjtObj.mjOBJ_JOINT
    constraint.data = np.zeros((len(constraint.data), 1))
    # Overdamped: two time constants, which together are that of a servo. A tighter one would tremble against contacts.
    constraint.solref = [0.25 * SERVO, math.sqrt(2.0)]
