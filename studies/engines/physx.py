"""PhysX, through SAPIEN, with a triangle mesh of the whole map that is cooked anew for every map."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from smartmesh_ros.ground.shapes import Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.engines.engine import Contacts, Engine, EngineBody, Setup

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # about pictures, which are not wanted here
    import sapien
    from sapien import physx


@dataclass(frozen=True, kw_only=True)
class PhysxOptions:
    """``contact_offset`` [m]: distance at which contacts begin. ``bounce_threshold`` [m/s]: slower impacts do not
    bounce. ``ccd``: continuous collision detection."""

    contact_offset: float = 0.01
    bounce_threshold: float = 0.2
    ccd: bool = False


class PhysxTrimesh(Engine):
    """PhysX mixes the coefficients of a contact by their mean, and the ground has one material: bodies of different
    friction or restitution get a mixture of theirs and the mean of all. Bodies never sleep."""

    name: ClassVar[str] = "physx"

    def __init__(self, setup: Setup, options: PhysxOptions | None = None) -> None:
        chosen = options or PhysxOptions()
        self._setup = setup
        self._steps = 0
        # These are global to SAPIEN and read when a scene, a shape or a body is made.
        physx.set_scene_config(
            gravity=np.array(setup.gravity, np.float32), bounce_threshold=chosen.bounce_threshold, enable_ccd=chosen.ccd
        )
        self._contact_offset = chosen.contact_offset
        physx.set_shape_config(contact_offset=self._contact_offset)
        physx.set_body_config(sleep_threshold=0.0)
        self._scene = sapien.Scene([physx.PhysxCpuSystem()])
        self._scene.set_timestep(setup.dt)
        friction = float(np.mean([body.friction for body in setup.bodies])) if setup.bodies else 0.5
        restitution = float(np.mean([body.restitution for body in setup.bodies])) if setup.bodies else 0.0
        self._material = physx.PhysxMaterial(friction, friction, restitution)
        self._bodies = [self._add(body) for body in setup.bodies]
        rows, columns = setup.heights.shape
        self._triangles = grid_triangles(rows, columns).astype(np.uint32)
        self._vertices = np.empty((rows * columns, 3), np.float32)
        row, column = np.divmod(np.arange(rows * columns), columns)
        self._vertices[:, 0], self._vertices[:, 1] = column * setup.resolution, row * setup.resolution
        self._scale = np.ones(3, np.float32)
        self._ground: Any = None
        self.set_ground(setup.heights)

    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        self._vertices[:, 2] = heights.ravel()
        if self._ground is not None:
            self._scene.remove_entity(self._ground)
        physx.set_shape_config(contact_offset=self._contact_offset)
        shape = physx.PhysxCollisionShapeTriangleMesh(self._vertices, self._triangles, self._scale, self._material)
        collider = physx.PhysxRigidStaticComponent()
        collider.attach(shape)
        self._ground = sapien.Entity()
        self._ground.add_component(collider)
        x, y = self._setup.offset(self._steps * self._setup.dt)
        self._ground.pose = sapien.Pose((x, y, 0.0))
        self._scene.add_entity(self._ground)

    def step(self) -> None:
        self._scene.step()
        self._steps += 1

    def positions(self) -> FloatArray:
        return np.array([body.entity_pose.p for body in self._bodies], np.float64).reshape(-1, 3)

    def orientations(self) -> FloatArray:
        wxyz = np.array([body.entity_pose.q for body in self._bodies], np.float64).reshape(-1, 4)
        return wxyz[:, [1, 2, 3, 0]]

    def velocities(self) -> FloatArray:
        twists = [[*body.linear_velocity, *body.angular_velocity] for body in self._bodies]
        return np.array(twists, np.float64).reshape(-1, 6)

    def contacts(self) -> Contacts:
        """Return the contacts of the last step; SAPIEN tells their normal forces only."""
        rows, index = [], {body.entity.per_scene_id: number for number, body in enumerate(self._bodies)}
        for contact in self._scene.get_contacts():
            first, second = (index.get(part.entity.per_scene_id) for part in contact.bodies)
            if first is not None and second is not None:
                continue
            own, sign = (first, 1.0) if first is not None else (second or 0, -1.0)
            body, dt = self._bodies[own], self._setup.dt
            before = body.entity_pose.p - dt * body.linear_velocity
            for point in contact.points:
                velocity = body.linear_velocity + np.cross(body.angular_velocity, point.position - before)
                force, normal = float(point.impulse @ point.normal) / dt, sign * point.normal
                rows.append((own, *point.position, *normal, point.separation, *velocity, force, *[np.nan] * 3))
        return Contacts.of(rows)

    def close(self) -> None:
        self._bodies.clear()
        self._ground = None
        self._scene = None

    def _add(self, body: EngineBody) -> Any:
        material = physx.PhysxMaterial(body.friction, body.friction, body.restitution)
        if isinstance(body.shape, Sphere):
            shape = physx.PhysxCollisionShapeSphere(body.shape.radius, material)
            volume = 4.0 / 3.0 * np.pi * body.shape.radius**3
        else:
            edges = np.array([body.shape.x, body.shape.y, body.shape.z])
            shape = physx.PhysxCollisionShapeBox((0.5 * edges).astype(np.float32), material)
            volume = edges.prod()
        shape.density = body.mass / volume
        state = body.state
        part = physx.PhysxRigidDynamicComponent()
        part.attach(shape)
        part.linear_damping = part.angular_damping = 0.0
        entity = sapien.Entity()
        entity.add_component(part)
        x, y, z, w = state.orientation
        entity.pose = sapien.Pose(state.position, (w, x, y, z))
        self._scene.add_entity(entity)
        part.linear_velocity = np.array(state.linear, np.float32)
        part.angular_velocity = np.array(state.angular, np.float32)
        return part
