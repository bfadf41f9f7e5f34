"""Bodies of every shape on moving ground for some seconds, with what users do to a world: for `make sanitize`.

Usage: python scripts/mixed_scenes.py SECONDS
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros.core import _core
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.trimesh import TriangleMesh

STEP = 1.0 / 240.0
STEPS = 240  # of one scene
SAMPLES = 80
SPACING = (0.04, 0.1, 0.3)  # [m]


class Scene:
    """A world with moving ground under bodies of every shape and a robot."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.client: Any = BulletClient(pb.DIRECT)
        self.client.setGravity(0.0, 0.0, -9.81)
        plugin = self.client.loadPlugin(_core.__file__, "_smartmesh")
        self.number = self.client.executePluginCommand(plugin, "", [])  # of the client, in the core
        self.ground = _core.Ground(self.number)
        self.ground.duration = STEP
        self.ground.set_sleep(0.05, 1e-2, 1.0, 2.5e-4, 3.0, 5e-3)
        self.spacing = float(rng.choice(SPACING))
        self.half = 0.5 * self.spacing * (SAMPLES - 1)
        self.map = HeightMap(self.heights(0.0), resolution=self.spacing, origin=(-self.half, -self.half))
        self.mesh = TriangleMesh(*self.folded(0.0))
        self.terrain = _core.Tiles()
        self.terrain.set_tiles([self.map.core_reader, self.mesh.core_reader])
        self.ground.set_tiles(self.terrain)
        self.fill()

    def heights(self, time: float) -> np.ndarray:
        y, x = np.mgrid[:SAMPLES, :SAMPLES] * self.spacing
        found = 0.2 * np.sin(x - 4.0 * time) * np.cos(0.7 * y) + self.rng.normal(scale=0.01, size=x.shape)
        found[self.rng.random(found.shape) < 0.01] = np.nan
        return found.astype(np.float32)

    def folded(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Returns the vertices and triangles of a tilted fan that opens and closes above the middle of the map."""
        angle = np.linspace(0.0, 2.0 * np.pi * abs(np.cos(2.0 * time)), 30)
        rim = np.stack([np.cos(angle), np.sin(angle), 0.5 + 0.1 * np.cos(9.0 * angle)], axis=1) * self.half
        vertices = np.concatenate([[[0.0, 0.0, 0.6 * self.half]], rim])
        return vertices, np.stack([np.zeros(29, np.int64), np.arange(1, 30), np.arange(2, 31)], axis=1)

    def shapes(self) -> list[int]:
        make, points = self.client.createCollisionShape, self.rng.normal(scale=0.1, size=(30, 3)).tolist()
        return [
            make(pb.GEOM_SPHERE, radius=0.15),
            make(pb.GEOM_BOX, halfExtents=[0.3, 0.2, 0.1]),
            make(pb.GEOM_CAPSULE, radius=0.1, height=0.3),
            make(pb.GEOM_CYLINDER, radius=0.15, height=0.1),
            make(pb.GEOM_MESH, vertices=points),
        ]

    def attach(self, body: int, link: int = -1) -> None:
        shape = self.client.createCollisionShape(pb.GEOM_SPHERE, radius=0.01)
        proxy = self.client.createMultiBody(0, shape, useMaximalCoordinates=1)
        slot = max(self.proxies, default=-1) + 1
        self.ground.attach(slot, body, link, proxy, _core.shapes_of(self.number, body)[link])
        self.proxies[slot] = proxy

    def fill(self) -> None:
        self.proxies: dict[int, int] = {}  # by slot
        self.bodies: list[int] = []
        for k, shape in enumerate(self.shapes() * 4):
            place = [*self.rng.uniform(-self.half, self.half, 2), self.rng.uniform(0.0, 1.0)]
            turn = self.rng.normal(size=4)
            body = self.client.createMultiBody(
                1.0, shape, -1, place, turn / np.linalg.norm(turn), useMaximalCoordinates=k % 2
            )
            self.client.resetBaseVelocity(body, self.rng.normal(scale=5.0, size=3), self.rng.normal(scale=5.0, size=3))
            self.bodies.append(body)
            self.attach(body)
        robot = self.client.loadURDF(f"{pybullet_data.getDataPath()}/husky/husky.urdf", [0.0, 0.0, 0.6])
        for link in range(-1, self.client.getNumJoints(robot)):
            if self.client.getCollisionShapeData(robot, link):
                self.attach(robot, link)

    def disturb(self) -> None:
        """Does one of the things that users do to a world."""
        kind, body = int(self.rng.integers(7)), int(self.rng.choice(self.bodies))
        if kind == 0:
            self.client.resetBaseVelocity(body, self.rng.normal(scale=100.0, size=3))
        elif kind == 1:
            self.client.resetBasePositionAndOrientation(body, [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
        elif kind == 2:
            self.client.resetBasePositionAndOrientation(body, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0])
        elif kind == 3 and len(self.bodies) > 5:
            self.bodies.remove(body)
            self.client.removeBody(body)
        elif kind == 4:
            slot = int(self.rng.choice(list(self.proxies)))
            self.client.removeBody(self.proxies.pop(slot))
            self.ground.detach(slot)
        elif kind == 5:
            slots = np.array(list(self.proxies))
            memory = self.ground.memory_of(slots)
            self.ground.forget()
            self.ground.recall(slots, memory)
        else:
            self.ground.wake(int(self.rng.choice(list(self.proxies))))

    def run(self) -> None:
        for step in range(STEPS):
            if step % 4 == 0:
                self.map.replace(self.heights(step * STEP), time=step * STEP)
                self.mesh.move(self.folded(step * STEP)[0], time=step * STEP)
            if step % 20 == 10:
                self.disturb()
            self.client.stepSimulation()
        self.client.resetSimulation()
        self.client.stepSimulation()
        self.client.disconnect()


if __name__ == "__main__":
    end, count = time.monotonic() + float(sys.argv[1]), 0
    while count == 0 or time.monotonic() < end:
        Scene(np.random.default_rng(count)).run()
        count += 1
    print(f"{count} scenes of {STEPS} steps", flush=True)
