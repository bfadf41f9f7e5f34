"""Bodies of every kind in a PyBullet world of their own, whose ground does what ground can do, and clients with it."""

import math
from functools import partial
from typing import Any

import numpy as np
import pybullet as pb
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Box, Cylinder, Deck, Ground, HeightMap, MotionConfig, Soil, Sphere, Terrain
from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.config import PhysicsConfig, SleepConfig, set_up
from smartmesh_ros.terrain.grid import FloatArray
from tests.bodies import put
from tests.urdfs import HUSKY

DT = 1.0 / 240.0
FLAT = np.zeros((41, 41))


class Scene:
    """Rigid bodies, multibodies, robots with joints, some of them fixed, on a map that waves and covers them, on one
    that is corrected and goes, and on decks. ``client``: None = one of its own. ``soil``: under the first half."""

    def __init__(self, client: Any = None, *, soil: bool = False) -> None:
        self.client = client or BulletClient(pb.DIRECT)
        set_up(self.client, PhysicsConfig())
        self.time, self.soil = 0.0, soil
        corrected = MotionConfig(changes="correction", settle=0.1)
        self.map = HeightMap(FLAT, resolution=0.1, origin=(-5.0, -2.0))
        self.corrected = HeightMap(FLAT, resolution=0.1, origin=(1.0, -2.0), motion=corrected)
        self.terrain = Terrain(self.map)
        self.terrain.put("corrected", self.corrected)
        self.ground = Ground(self.client, self.terrain)
        if soil:
            self.ground.set_soil(Soil(self.map, "dry_sand"))
        self.bodies: list[int] = []
        for row, x in enumerate((-4.0, 2.0)):
            for column, shape in enumerate((Box(0.4, 0.3, 0.2), Cylinder(radius=0.1, height=0.2), Sphere(0.1))):
                for above in (0.1, 0.5):
                    place = (x + 0.013 + 0.1 * above, column - 1.2, above)
                    self.bodies.append(put(self.client, shape, place, useMaximalCoordinates=(row + column) % 2))
            for base, fixed in ((0.3, False), (0.2, True)):
                at = (x + 1.0, -1.0 + 2.0 * fixed, base)
                unseen = pb.URDF_IGNORE_VISUAL_SHAPES  # which take most of the time of the scene
                self.bodies.append(self.client.loadURDF(HUSKY, at, useFixedBase=fixed, flags=unseen))
        for name, carrier in (("ship", None), ("bed", self.bodies[6])):
            tile = HeightMap(np.zeros((9, 9)), resolution=0.1, origin=(-0.4, -0.4))
            self.terrain.put(name, Deck(tile, thickness=0.1, position=(-2.0, 0.0, 1.0)))
            if carrier is not None:
                self.ground.carry(name, carrier, position=(0.0, 0.0, 0.4))
        self.bodies += [put(self.client, Sphere(0.1), place) for place in ((-2.0, 0.0, 1.1), (-3.0, -1.0, 0.8))]
        for body in self.bodies:
            self.ground.attach(body)
        self.ground.drive(self.bodies[0], -1, (0.0, 1.0, 0.0), 0.1)
        self.ground.let_sleep(SleepConfig(after=0.2))

    def disturb(self) -> None:
        """Do what belongs before a step."""
        step, time = round(self.time / DT), self.time
        if step % 8 == 0 and step < 200 and not self.soil:
            self.map.replace(0.02 * np.sin(0.2 * np.arange(41) - 3.0 * time) + FLAT, time=time)
        if step % 8 == 3 and step < 400:
            roll = 0.1 * math.sin(3.0 * time)
            turn = (math.sin(roll), 0.0, 0.0, math.cos(roll))
            self.terrain.deck("ship").move((-2.0, 0.0, 1.0 + roll), turn, time=time)
        if step == 240:
            self.map.replace(FLAT + 0.25, time=time + 100.0)  # long after: no velocity
        if step in (240, 480):
            self.corrected.replace(FLAT + 0.02 * step / 240, time=time)
        if step == 600:
            self.client.resetBaseVelocity(self.bodies[2], (0.0, 0.0, 1.0))
        if step == 660:
            self.terrain.remove("corrected")

    def bases(self) -> FloatArray:
        """States of the bases of those bodies that are there."""
        there = map(self.client.getBodyUniqueId, range(self.client.getNumBodies()))
        return BulletCalls(self.client).states(sorted({*self.bodies} & {*there}))

    def state(self) -> FloatArray:
        """All that PyBullet tells of the bodies and links, who sleeps, and the time of the ground."""
        found = [self.bases().ravel()]
        for body in self.bodies:
            if joints := range(self.client.getNumJoints(body)):
                links = self.client.getLinkStates(body, joints, 1)
                found.append(np.array([np.concatenate([*link[:2], *link[6:8]]) for link in links]).ravel())
        return np.concatenate([*found, [*map(self.ground.is_asleep, self.bodies), self.ground.clock]])

    def run(self, steps: int, *, by_pybullet: bool = False) -> FloatArray:
        """Step, ``by_pybullet`` by its own call, and return the states after each step."""
        found = []
        for _ in range(steps):
            self.disturb()
            if by_pybullet:
                self.client.stepSimulation()
            else:
                self.ground.step(self.time, DT)
            self.time += DT
            found.append(self.state())
        return np.array(found)


class Client:
    """A client by its number, without a `BulletClient`'s output and limits."""

    def __init__(self, *connection: Any, **options: Any) -> None:
        self._client = pb.connect(*connection, **options)
        assert self._client >= 0

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(pb, name), physicsClientId=self._client)


def run(client: Any) -> bytes:
    """Run a scene for a sixth of a second; returns the states after each step to the last digit."""
    scene = Scene(client)
    states = scene.run(40)
    scene.ground.close()
    return states.tobytes()


def in_real_time(client: Any) -> tuple[int, bytes]:
    """Let the server of a client step a scene on its own for a while; returns the steps, and the state after them."""
    scene = Scene(client)
    client.setRealTimeSimulation(1)
    while scene.ground.clock < 0.2:
        client.getNumBodies()
    client.setRealTimeSimulation(0)
    return round(scene.ground.clock / DT), scene.state().tobytes()


def by_steps(client: Any, steps: int) -> bytes:
    """Let a client run the steps of `in_real_time`; returns the state after them."""
    scene = Scene(client)
    for _ in range(steps):
        client.stepSimulation()
    return scene.state().tobytes()
