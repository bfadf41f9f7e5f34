"""PyBullet clients, and scenes that are the same in each."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros import Ground, HeightMap
from smartmesh_ros.terrain.grid import FloatArray

DT = 1.0 / 240.0
X = np.tile(np.linspace(-5.0, 5.0, 101), (101, 1))


class Client:
    """A client by its number, without a `BulletClient`'s output and limits."""

    def __init__(self, *connection: Any, **options: Any) -> None:
        self._client = pb.connect(*connection, **options)
        assert self._client >= 0

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(pb, name), physicsClientId=self._client)


def waves(time: float) -> FloatArray:
    """Heights (101, 101) [m] of ground that moves."""
    return 0.2 * np.sin(X + 4.0 * time) + 0.02 * np.sin(7.0 * X.T)


class Scene:
    """Three shapes and two links with a joint on moving ground in a client."""

    def __init__(self, client: Any) -> None:
        self.client = client
        client.setGravity(0.0, 0.0, -9.81)
        client.setPhysicsEngineParameter(contactBreakingThreshold=0.02)  # one for all clients of a process
        self.terrain = HeightMap(waves(0.0), resolution=0.1, origin=(-5.0, -5.0))
        self.ground = Ground(client, self.terrain)
        shapes: tuple[dict[str, Any], ...] = (
            {"shapeType": pb.GEOM_SPHERE, "radius": 0.15},
            {"shapeType": pb.GEOM_BOX, "halfExtents": [0.2, 0.15, 0.1]},
            {"shapeType": pb.GEOM_CYLINDER, "radius": 0.15, "height": 0.2},
        )
        made = [client.createCollisionShape(**shape) for shape in shapes]
        self.bodies = [client.createMultiBody(1.0, shape, -1, (k - 1.5, 0.3 * k, 0.25)) for k, shape in enumerate(made)]
        self.bodies.append(
            client.createMultiBody(
                1.0, made[1], -1, (0.0, 2.0, 0.25), linkMasses=[0.5], linkCollisionShapeIndices=[made[0]],
                linkVisualShapeIndices=[-1], linkPositions=[(0.4, 0.0, 0.0)], linkOrientations=[(0.0, 0.0, 0.0, 1.0)],
                linkInertialFramePositions=[(0.0, 0.0, 0.0)], linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)],
                linkParentIndices=[0], linkJointTypes=[pb.JOINT_REVOLUTE], linkJointAxis=[(0.0, 1.0, 0.0)],
            )
        )  # fmt: skip
        for body in self.bodies:
            self.ground.attach(body)

    def step(self, steps: int) -> None:
        """Run steps, with a map before every fourth."""
        for step in range(steps):
            if step % 4 == 0:
                self.terrain.replace(waves(step * DT), time=step * DT)
            self.ground.step(step * DT, DT)

    def states(self) -> bytes:
        """Poses and velocities of the bodies to the last digit, and the positions and forces of their contacts."""
        client, numbers = self.client, []
        for body in self.bodies:
            numbers += [*client.getBasePositionAndOrientation(body), *client.getBaseVelocity(body)]
            numbers += [(*point[5], *point[6], point[8], point[9]) for point in client.getContactPoints(body)]
        return np.concatenate(numbers).tobytes()


def run(client: Any) -> bytes:
    """Run a scene for a sixth of a second; returns the states at the end."""
    scene = Scene(client)
    scene.step(40)
    states = scene.states()
    scene.ground.close()
    return states


def in_real_time(client: Any) -> tuple[int, bytes]:
    """Let the server of a client step a scene on its own for a while; returns the steps, and the states after
    them."""
    scene = Scene(client)
    client.setRealTimeSimulation(1)
    while scene.ground.clock < 0.2:
        client.getNumBodies()
    client.setRealTimeSimulation(0)
    return round(scene.ground.clock / DT), scene.states()


def by_steps(client: Any, steps: int) -> bytes:
    """Let a client run the steps of `in_real_time`; returns the states after them."""
    scene = Scene(client)
    for _ in range(steps):
        client.stepSimulation()
    return scene.states()
