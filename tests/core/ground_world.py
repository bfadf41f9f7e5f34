"""A PyBullet world whose ground is in the C++ core: bodies of each shape on height maps and meshes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import TriangleMesh

STEP = 1.0 / 240.0


class Shape(NamedTuple):
    """A collision shape: PyBullet's arguments, and the height of its centre at rest [m]."""

    arguments: dict[str, Any]
    height: float


BALL = Shape({"shapeType": pybullet.GEOM_SPHERE, "radius": 0.1}, 0.1)
BOX = Shape({"shapeType": pybullet.GEOM_BOX, "halfExtents": [0.1, 0.08, 0.06]}, 0.06)
CYLINDER = Shape({"shapeType": pybullet.GEOM_CYLINDER, "radius": 0.1, "height": 0.16}, 0.08)
CAPSULE = Shape({"shapeType": pybullet.GEOM_CAPSULE, "radius": 0.06, "height": 0.2}, 0.16)
SHAPES = {"ball": BALL, "box": BOX, "cylinder": CYLINDER, "capsule": CAPSULE}


class GroundWorld:
    """Bodies on ground of height maps and meshes, at the standard rate and gravity."""

    def __init__(self, *parts: HeightMap | TriangleMesh, step: float = STEP) -> None:
        self.client = BulletClient(pybullet.DIRECT)
        self.client.setGravity(0.0, 0.0, -9.81)
        self.client.setTimeStep(step)
        self.client.setPhysicsEngineParameter(solverResidualThreshold=0.0, contactERP=0.3, erp=0.3)
        plugin = self.client.loadPlugin(_core.__file__, "_smartmesh")
        self.ground = _core.Ground(self.client.executePluginCommand(plugin, "", []))
        self.ground.duration = self.step = step
        self.ground.set_tiles([part.core_reader for part in parts])
        self.proxy = self.client.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.01)

    def __enter__(self) -> GroundWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.client.disconnect()

    def add(
        self, shape: Shape, at: Sequence[float], *, turn: Sequence[float] = (0, 0, 0), friction: float = 0.5
    ) -> int:
        """Return a body of 1 kg with its centre at a point [m]."""
        body = self.client.createMultiBody(
            1.0, self.client.createCollisionShape(**shape.arguments), basePosition=list(at),
            baseOrientation=pybullet.getQuaternionFromEuler(turn), useMaximalCoordinates=1,
        )  # fmt: skip
        self.client.changeDynamics(
            body, -1, linearDamping=0.0, angularDamping=0.0, lateralFriction=friction, restitution=0.0
        )
        proxy = self.client.createMultiBody(0.0, self.proxy, useMaximalCoordinates=1)
        self.ground.attach(self.client.getNumBodies(), body, -1, proxy)
        return int(body)

    def push(self, body: int, linear: Iterable[float], angular: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
        """Set the velocity of a body [m/s], [rad/s]."""
        self.client.resetBaseVelocity(body, list(linear), list(angular))

    def run(self, seconds: float) -> None:
        """Step the world for a time [s]."""
        for _ in range(round(seconds / self.step)):
            self.client.stepSimulation()

    def position(self, body: int) -> NDArray[np.float64]:
        """Return the centre of a body [m]."""
        return np.array(self.client.getBasePositionAndOrientation(body)[0])

    def velocity(self, body: int) -> NDArray[np.float64]:
        """Return the linear velocity of a body [m/s]."""
        return np.array(self.client.getBaseVelocity(body)[0])
