"""Robots in PhysX: SAPIEN's own URDF loader, on a triangle mesh of the whole map that is cooked anew for every map."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.engine import Links
from studies.engines.physx import BODY, GROUND, PhysxGround, Pose
from studies.robots.engine import FRICTION, SERVO, RobotEngine, RobotSetup, xyzw

# Gain [Nm s/rad] of the servos: joints follow as far as the torque allows, as PyBullet's do.
GAIN = 200.0


class PhysxRobots(PhysxGround, RobotEngine):
    """Articulations of the loader. ``sleeps``: robots at rest fall asleep, by SAPIEN's own threshold, and wake when the
    ground's mesh is exchanged."""

    has_prisms: ClassVar[bool] = True

    def __init__(self, setup: RobotSetup, *, sleeps: bool = False) -> None:
        super().__init__(setup, FRICTION, 0.0, 0.005 if sleeps else 0.0)
        self._robots = [self._add(setup, start, sleeps=sleeps) for start in setup.starts]
        self.names = tuple(link.name for link in self._robots[0].links if link.collision_shapes)
        self._links = [[robot.find_link_by_name(name) for name in self.names] for robot in self._robots]
        masses = np.array([link.mass for link in self._robots[0].links])
        self._shares = masses / masses.sum()
        self.set_ground(self.ready(setup.heights))

    def _add(self, setup: RobotSetup, start: FloatArray, *, sleeps: bool) -> Any:
        loader = self.scene.create_urdf_loader()
        loader.fix_root_link = False
        loader.set_material(FRICTION, FRICTION, 0.0)
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file.write(setup.text)
            file.flush()
            robot = loader.load(file.name)
        if not sleeps:
            robot.sleep_threshold = 0.0
        for link in robot.links:
            link.linear_damping = link.angular_damping = 0.0
            for shape in link.collision_shapes:
                shape.set_collision_groups([BODY, GROUND, 0, 0])
        stance, torque = setup.robot.stance, setup.robot.torque
        positions = robot.qpos
        for index, joint in enumerate(robot.active_joints):
            name = joint.name
            joint.friction = 0.0
            if name in stance:
                positions[index] = stance[name]
                joint.set_drive_properties(GAIN / SERVO, GAIN, torque, "force")
                joint.set_drive_target(stance[name])
            elif name in setup.robot.wheels:
                joint.set_drive_properties(0.0, GAIN, torque, "force")
                joint.set_drive_velocity_target(setup.speed)
            else:
                joint.set_drive_properties(0.0, 0.0, 0.0, "force")
        robot.set_qpos(positions)
        robot.set_root_pose(Pose(start.astype(np.float32)))
        return robot

    def hold(self, positions: Mapping[str, float]) -> None:
        for robot in self._robots:
            for joint in robot.active_joints:
                if joint.name in positions:
                    joint.set_drive_target(positions[joint.name])

    def links(self) -> Links:
        poses = [[link.entity_pose for link in links] for links in self._links]
        positions = np.array([[pose.p for pose in row] for row in poses], np.float64)
        return Links(positions, xyzw(np.array([[pose.q for pose in row] for row in poses], np.float64)))

    def velocities(self) -> FloatArray:
        linear = np.array([[link.linear_velocity for link in robot.links] for robot in self._robots], np.float64)
        return np.asarray(np.einsum("l,nlk->nk", self._shares, linear))

    def close(self) -> None:
        self._robots.clear()
        super().close()
