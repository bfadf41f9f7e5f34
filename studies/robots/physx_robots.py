"""Robots in PhysX: SAPIEN's own URDF loader, and a triangle mesh of the whole map that is cooked anew for every map."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smartmesh_ros.scenes.moving import FloatGrid
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.robots.engine import FRICTION, SERVO, Links, RobotEngine, RobotSetup, xyzw

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # about pictures, which are not wanted here
    import sapien
    from sapien import physx

# Gain [Nm s/rad] of the servos: joints follow as far as the torque allows, as PyBullet's do.
GAIN = 200.0
# Groups of the robots and of the ground: robots touch the ground, and not one another.
ROBOT, GROUND = 1, 2


@dataclass(frozen=True, kw_only=True)
class PhysxRobotOptions:
    """``sleeps``: robots at rest fall asleep, by SAPIEN's own threshold. ``contact_offset`` [m]: distance at which
    contacts begin."""

    sleeps: bool = False
    contact_offset: float = 0.01


class PhysxRobots(RobotEngine):
    """Articulations of the loader. The ground has no velocity in contacts. Sleeping robots wake when the ground's mesh
    is exchanged."""

    has_prisms: ClassVar[bool] = True

    def __init__(self, setup: RobotSetup, options: PhysxRobotOptions | None = None) -> None:
        chosen = options or PhysxRobotOptions()
        self._scene = sapien.Scene([physx.PhysxCpuSystem()])
        self._scene.set_timestep(setup.dt)
        self._contact_offset = chosen.contact_offset
        self._material = physx.PhysxMaterial(FRICTION, FRICTION, 0.0)
        physx.set_shape_config(contact_offset=chosen.contact_offset)
        physx.set_scene_config(gravity=np.array((0.0, 0.0, -9.81), np.float32))
        physx.set_body_config(sleep_threshold=0.005 if chosen.sleeps else 0.0)
        self._robots = [self._add(setup, start, sleeps=chosen.sleeps) for start in setup.starts]
        self.names = tuple(link.name for link in self._robots[0].links if link.collision_shapes)
        self._links = [[robot.find_link_by_name(name) for name in self.names] for robot in self._robots]
        masses = np.array([link.mass for link in self._robots[0].links])
        self._shares = masses / masses.sum()
        rows, columns = setup.heights.shape
        self._triangles = grid_triangles(rows, columns).astype(np.uint32)
        row, column = np.divmod(np.arange(rows * columns), columns)
        x, y, _ = setup.geometry.origin
        step = setup.geometry.resolution
        self._vertices = np.column_stack([x + column * step, y + row * step, 0.0 * row]).astype(np.float32)
        self._ground: Any = None
        self.set_ground(setup.heights)

    def _add(self, setup: RobotSetup, start: FloatArray, *, sleeps: bool) -> Any:
        loader = self._scene.create_urdf_loader()
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
                shape.set_collision_groups([ROBOT, GROUND, 0, 0])
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
        robot.set_root_pose(sapien.Pose(start.astype(np.float32)))
        return robot

    def set_ground(self, heights: FloatGrid) -> None:
        self._vertices[:, 2] = heights.ravel()
        if self._ground is not None:
            self._scene.remove_entity(self._ground)
        physx.set_shape_config(contact_offset=self._contact_offset)
        shape = physx.PhysxCollisionShapeTriangleMesh(
            self._vertices, self._triangles, np.ones(3, np.float32), self._material
        )
        shape.set_collision_groups([GROUND, ROBOT, 0, 0])
        collider = physx.PhysxRigidStaticComponent()
        collider.attach(shape)
        self._ground = sapien.Entity()
        self._ground.add_component(collider)
        self._scene.add_entity(self._ground)

    def hold(self, positions: Mapping[str, float]) -> None:
        for robot in self._robots:
            for joint in robot.active_joints:
                if joint.name in positions:
                    joint.set_drive_target(positions[joint.name])

    def step(self) -> None:
        self._scene.step()

    def links(self) -> Links:
        poses = [[link.entity_pose for link in links] for links in self._links]
        positions = np.array([[pose.p for pose in row] for row in poses], np.float64)
        return Links(positions, xyzw(np.array([[pose.q for pose in row] for row in poses], np.float64)))

    def velocities(self) -> FloatArray:
        linear = np.array([[link.linear_velocity for link in robot.links] for robot in self._robots], np.float64)
        return np.asarray(np.einsum("l,nlk->nk", self._shares, linear))

    def close(self) -> None:
        self._robots.clear()
        self._ground = None
        self._scene = None
