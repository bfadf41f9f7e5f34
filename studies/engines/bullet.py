"""PyBullet with one collider of the whole map: the report's Simple-Mesh."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.colliders.made import HOLE
from smartmesh_ros.patches.config import MOST_INDICES, MOST_VERTICES
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.trimesh import grid_triangles
from studies.engines.engine import Contacts, Engine, EngineBody, Setup

# Fraction of a penetration that the solver corrects per step. The same as the package's default, so that engines differ
# in their colliders only.
CONTACT_ERP = 0.2
# Orientation of a heightfield that makes the diagonals of PyBullet's cells agree with ours.
QUARTER_TURN = (0.0, 0.0, math.sin(0.25 * math.pi), math.cos(0.25 * math.pi))


@dataclass(frozen=True, kw_only=True)
class BulletTrimeshOptions:
    """``edge_filter``: no ghost collisions at inner edges."""

    edge_filter: bool = False
    contact_erp: float = CONTACT_ERP


@dataclass(frozen=True, kw_only=True)
class BulletHeightfieldOptions:
    """``edge_filter``: no ghost collisions at inner edges. ``carry_velocity``: the collider moves with the mean
    velocity of the map, which is only useful if all ground has the same velocity."""

    edge_filter: bool = False
    carry_velocity: bool = False
    contact_erp: float = CONTACT_ERP


class _Bullet(Engine):
    """Common part of both engines: the client and the bodies."""

    def __init__(self, setup: Setup, contact_erp: float) -> None:
        self._setup = setup
        self._steps = 0
        self._client: Any = BulletClient(pb.DIRECT)
        self._client.setGravity(*setup.gravity)
        self._client.setTimeStep(setup.dt)
        self._client.setPhysicsEngineParameter(contactERP=contact_erp, erp=contact_erp)
        self._uids = [self._add(body) for body in setup.bodies]

    def step(self) -> None:
        self._client.stepSimulation()
        self._steps += 1

    def _slid(self) -> tuple[float, float]:
        """Return the current displacement of the map along x and y [m]."""
        return self._setup.offset(self._steps * self._setup.dt)

    def positions(self) -> FloatArray:
        return body_arrays(self._client, self._uids)[0]

    def orientations(self) -> FloatArray:
        return body_arrays(self._client, self._uids)[1]

    def velocities(self) -> FloatArray:
        return body_arrays(self._client, self._uids)[2]

    def contacts(self) -> Contacts:
        return bullet_contacts(self._client, base_parts(self._uids), self._setup.dt)

    def close(self) -> None:
        if self._client.isConnected():
            self._client.disconnect()

    def _add(self, body: EngineBody) -> int:
        client, state = self._client, body.state
        shape = client.createCollisionShape(**body.shape.bullet())
        uid = client.createMultiBody(
            body.mass, shape, basePosition=state.position, baseOrientation=state.orientation, useMaximalCoordinates=1
        )
        client.changeDynamics(
            uid,
            -1,
            lateralFriction=body.friction,
            restitution=body.restitution,
            linearDamping=0.0,
            angularDamping=0.0,
        )
        client.resetBaseVelocity(uid, state.linear, state.angular)
        return int(uid)

    def _ground(self, shape: int, position: Any, orientation: Any) -> int:
        uid = self._client.createMultiBody(0.0, shape, basePosition=position, baseOrientation=orientation)
        # PyBullet multiplies the coefficients of both bodies. With 1 here, those of the moving body apply.
        self._client.changeDynamics(uid, -1, lateralFriction=1.0, restitution=1.0)
        return int(uid)


class BulletTrimesh(_Bullet):
    """A triangle mesh of the whole map, rebuilt for every map. PyBullet leaks some memory of each mesh."""

    name: ClassVar[str] = "bullet_trimesh"

    def __init__(self, setup: Setup, options: BulletTrimeshOptions | None = None) -> None:
        chosen = options or BulletTrimeshOptions()
        rows, columns = setup.heights.shape
        triangles = grid_triangles(rows, columns)
        if rows * columns > MOST_VERTICES or triangles.size > MOST_INDICES:
            raise InputError("size", f"PyBullet takes no trimesh of {rows} x {columns} vertices; take a smaller map")
        super().__init__(setup, chosen.contact_erp)
        self._flags = pb.GEOM_FORCE_CONCAVE_TRIMESH | (pb.GEOM_CONCAVE_INTERNAL_EDGE if chosen.edge_filter else 0)
        self._indices = triangles.ravel().tolist()
        self._vertices = np.empty((rows * columns, 3))
        row, column = np.divmod(np.arange(rows * columns), columns)
        self._vertices[:, 0], self._vertices[:, 1] = column * setup.resolution, row * setup.resolution
        self._uid = -1
        self.set_ground(setup.heights)

    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        self._vertices[:, 2] = heights.ravel()
        if self._uid >= 0:
            self._client.removeBody(self._uid)
        shape = self._client.createCollisionShape(
            pb.GEOM_MESH, vertices=self._vertices.tolist(), indices=self._indices, flags=self._flags
        )
        self._uid = self._ground(shape, (*self._slid(), 0.0), (0.0, 0.0, 0.0, 1.0))


class BulletHeightfield(_Bullet):
    """A heightfield of the whole map, replaced in place for every map."""

    name: ClassVar[str] = "bullet_heightfield"

    def __init__(self, setup: Setup, options: BulletHeightfieldOptions | None = None) -> None:
        chosen = options or BulletHeightfieldOptions()
        super().__init__(setup, chosen.contact_erp)
        rows, columns = setup.heights.shape
        # With the quarter turn, PyBullet's rows run along x.
        self._layout = {"numHeightfieldRows": rows, "numHeightfieldColumns": columns}
        self._flags = pb.GEOM_CONCAVE_INTERNAL_EDGE if chosen.edge_filter else 0
        self._carry = chosen.carry_velocity
        bounds = np.zeros(rows * columns)
        bounds[0], bounds[-1] = (
            -HOLE,
            HOLE,
        )  # PyBullet never updates the bounds of a heightfield
        self._shape: int = self._client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD,
            meshScale=[setup.resolution, setup.resolution, 1.0],
            heightfieldData=bounds.tolist(),
            **self._layout,
        )
        width, length = setup.size
        self._pose = ((0.5 * width, 0.5 * length, 0.0), QUARTER_TURN)
        self._uid = self._ground(self._shape, *self._pose)
        self.set_ground(setup.heights)

    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        self._client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD,
            flags=self._flags,
            heightfieldData=np.rot90(heights).ravel().tolist(),
            replaceHeightfieldIndex=self._shape,
            **self._layout,
        )
        if self._setup.slides:
            x, y = self._slid()
            (base_x, base_y, base_z), orientation = self._pose
            self._client.resetBasePositionAndOrientation(self._uid, (base_x + x, base_y + y, base_z), orientation)
        if self._carry and velocities is not None:
            # A step moves a body that has a velocity. Resetting its pose also sets the velocity to zero, so the pose
            # comes first.
            self._client.resetBasePositionAndOrientation(self._uid, *self._pose)
            self._client.resetBaseVelocity(self._uid, (0.0, 0.0, float(velocities.mean())), (0.0, 0.0, 0.0))


def body_arrays(client: Any, uids: list[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions (N, 3) [m], orientations (N, 4) and velocities (N, 6) [m/s, rad/s] of PyBullet's bodies."""
    poses = [client.getBasePositionAndOrientation(uid) for uid in uids]
    twists = [client.getBaseVelocity(uid) for uid in uids]
    return (
        np.array([pose[0] for pose in poses]).reshape(-1, 3),
        np.array([pose[1] for pose in poses]).reshape(-1, 4),
        np.array([[*linear, *angular] for linear, angular in twists]).reshape(-1, 6),
    )


def base_parts(uids: list[int]) -> dict[tuple[int, int], int]:
    """Return the bases of PyBullet's bodies with their indices."""
    return {(uid, -1): index for index, uid in enumerate(uids)}


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
        velocity = _velocity_at(client, part, place, dt)
        normal = sign * np.array(point[7])
        rows.append((parts[part], *place, *normal, point[8], *velocity, point[9], *(sign * friction)))
    return Contacts.of(rows)


def _velocity_at(client: Any, part: tuple[int, int], point: tuple[float, ...], dt: float) -> FloatArray:
    """Return the velocity (3,) [m/s] after a step of what was at a ``point`` before it."""
    body, link = part
    if link < 0:
        centre, (linear, angular) = client.getBasePositionAndOrientation(body)[0], client.getBaseVelocity(body)
    else:
        state = client.getLinkState(body, link, computeLinkVelocity=1)
        centre, linear, angular = state[0], state[6], state[7]
    arm = np.array(point) - (np.array(centre) - dt * np.array(linear))
    return np.asarray(linear + np.cross(angular, arm))
