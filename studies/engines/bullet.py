"""PyBullet with one collider of the whole map: the report's Simple-Mesh."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import InputError, PhysicsConfig
from smartmesh_ros.ground.shown_ground import make_shape, quarter_turn, replace_heights
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.engines.engine import Contacts, Engine, EngineBody, GroundSetup, Setup
from studies.report.made import HOLE

# Largest arrays that PyBullet accepts.
MOST_VERTICES, MOST_INDICES = 131_072, 524_288


def corrected_share(dt: float) -> float:
    """Return the share of a penetration that the solver corrects in a step of ``dt`` [s].

    At the default rate of our worlds it is their share, so that engines differ in their colliders alone. In shorter
    steps it is less in proportion, because the same share would throw the bodies of fine references.
    """
    default = PhysicsConfig()
    return default.contact_erp * default.rate * dt


class BulletEngine(Engine):
    """Bodies ``uids`` of a PyBullet ``client``."""

    client: Any
    uids: list[int]
    setup: GroundSetup

    def poses(self) -> FloatArray:
        poses = [self.client.getBasePositionAndOrientation(uid) for uid in self.uids]
        return np.array([[*position, *orientation] for position, orientation in poses]).reshape(-1, 7)

    def add(self, body: EngineBody, **more: Any) -> int:
        """Return the id of a new body, made with ``more`` arguments of PyBullet."""
        client, state = self.client, body.state
        shape = client.createCollisionShape(**body.shape.bullet())
        uid = client.createMultiBody(
            body.mass, shape, basePosition=state.position, baseOrientation=state.orientation, **more
        )
        client.changeDynamics(
            uid, -1, lateralFriction=body.friction, restitution=body.restitution, linearDamping=0.0, angularDamping=0.0
        )
        client.resetBaseVelocity(uid, state.linear, state.angular)
        return int(uid)

    def velocities(self) -> FloatArray:
        twists = [self.client.getBaseVelocity(uid) for uid in self.uids]
        return np.array([[*linear, *angular] for linear, angular in twists]).reshape(-1, 6)

    def contacts(self) -> Contacts:
        parts = {(uid, -1): index for index, uid in enumerate(self.uids)}
        return bullet_contacts(self.client, parts, self.setup.dt)


class _WholeMap(BulletEngine):
    """Common part of both engines: the client and the bodies."""

    def __init__(self, setup: Setup) -> None:
        self.setup, self._steps = setup, 0
        self.client = BulletClient(pb.DIRECT)
        self.client.setGravity(*setup.gravity)
        self.client.setTimeStep(setup.dt)
        share = corrected_share(setup.dt)
        self.client.setPhysicsEngineParameter(contactERP=share, erp=share)
        self.uids = [self.add(body, useMaximalCoordinates=1) for body in setup.bodies]

    def step(self) -> None:
        self.client.stepSimulation()
        self._steps += 1

    def close(self) -> None:
        if self.client.isConnected():
            self.client.disconnect()

    def _ground(self, shape: int, position: Any, orientation: Any) -> int:
        uid = self.client.createMultiBody(0.0, shape, basePosition=position, baseOrientation=orientation)
        # PyBullet multiplies the coefficients of both bodies. With 1 here, those of the moving body apply.
        self.client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        return int(uid)


class BulletTrimesh(_WholeMap):
    """A triangle mesh of the whole map, rebuilt for every map. PyBullet leaks some memory of each mesh.
    ``edge_filter``: no ghost collisions at inner edges."""

    def __init__(self, setup: Setup, *, edge_filter: bool = False) -> None:
        rows, columns = setup.heights.shape
        triangles = grid_triangles(rows, columns)
        if rows * columns > MOST_VERTICES or triangles.size > MOST_INDICES:
            raise InputError("size", f"PyBullet takes no trimesh of {rows} x {columns} vertices; take a smaller map")
        super().__init__(setup)
        self._flags = pb.GEOM_FORCE_CONCAVE_TRIMESH | (pb.GEOM_CONCAVE_INTERNAL_EDGE if edge_filter else 0)
        self._indices = triangles.ravel().tolist()
        self._vertices = setup.vertices()
        self._uid = -1
        self.set_ground(self.ready(setup.heights))

    def set_ground(self, ready: FloatArray) -> None:
        self._vertices[:, 2] = ready.ravel()
        if self._uid >= 0:
            self.client.removeBody(self._uid)
        shape = self.client.createCollisionShape(
            pb.GEOM_MESH, vertices=self._vertices.tolist(), indices=self._indices, flags=self._flags
        )
        self._uid = self._ground(shape, (*self.setup.offset(self._steps * self.setup.dt), 0.0), (0.0, 0.0, 0.0, 1.0))


class BulletHeightfield(_WholeMap):
    """A heightfield of the whole map, replaced in place for every map."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        if setup.plane:
            self._ground(self.client.createCollisionShape(pb.GEOM_PLANE), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            return
        rows, columns = setup.heights.shape
        self._shape = make_shape(self.client, rows, columns, setup.resolution, HOLE)
        self._uid = self._ground(self._shape, *self._pose())
        self.set_ground(self.ready(setup.heights))

    def _pose(self) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        (width, length), (x, y) = self.setup.size, self.setup.offset(self._steps * self.setup.dt)
        return (0.5 * width + x, 0.5 * length + y, 0.0), quarter_turn(0.0)

    def set_ground(self, ready: FloatArray) -> None:
        replace_heights(self.client, self._shape, ready)
        if self.setup.slides:
            self.client.resetBasePositionAndOrientation(self._uid, *self._pose())


def bullet_contacts(client: Any, parts: Mapping[tuple[int, int], int], dt: float) -> Contacts:
    """Return the contacts of ``parts``, PyBullet's bodies and links by their indices, with others, in a step of ``dt``
    [s]."""
    rows = []
    for point in client.getContactPoints():
        first, second = (point[1], point[3]), (point[2], point[4])
        if (first in parts) == (second in parts):
            continue
        # Normal and forces are those on the first body.
        part, place, sign = (first, point[5], 1.0) if first in parts else (second, point[6], -1.0)
        friction = point[10] * np.array(point[11]) + point[12] * np.array(point[13])
        if part[1] < 0:
            centre, _ = client.getBasePositionAndOrientation(part[0])
            linear, angular = client.getBaseVelocity(part[0])
        else:
            state = client.getLinkState(*part, computeLinkVelocity=1)
            centre, linear, angular = state[0], state[6], state[7]
        # After the step, of what was at the point before it.
        velocity = np.add(linear, np.cross(angular, np.array(place) - (np.array(centre) - dt * np.array(linear))))
        normal = sign * np.array(point[7])
        rows.append((parts[part], *place, *normal, point[8], *velocity, point[9], *(sign * friction)))
    return Contacts.of(rows)
