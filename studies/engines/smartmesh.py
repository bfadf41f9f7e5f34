"""This package as an engine: contacts from the map, or the report's colliders."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.limits import FARTHEST_BODY
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.settings import FallConfig
from smartmesh_ros.world.world import WorldConfig
from studies.engines.bullet import BulletEngine
from studies.engines.engine import GroundSetup, Setup, Simulation
from studies.report.config import ReportConfig
from studies.report.ground import world_on

# What falls off the ground is measured to the end, as in the other engines.
NEVER_LOST = FallConfig(depth=FARTHEST_BODY)


class WorldGround(Simulation):
    """A `World` on a `HeightMap`, with contacts from the map or from the ``report``'s colliders. The setup overrides
    step rate and gravity of ``physics``."""

    def __init__(
        self,
        setup: GroundSetup,
        *,
        report: ReportConfig | None = None,
        motion: MotionConfig | None = None,
        physics: PhysicsConfig | None = None,
    ) -> None:
        self.setup = setup
        self.heightmap = HeightMap(setup.heights, resolution=setup.resolution, origin=setup.origin, motion=motion)
        physics = replace(physics or PhysicsConfig(), rate=1.0 / setup.dt, gravity=setup.gravity)
        self.world = world_on(self.heightmap, WorldConfig(physics=physics, falls=NEVER_LOST), report)
        self.client = self.world.client

    def ready(self, heights: Any) -> Any:
        return heights

    def set_ground(self, ready: Any) -> None:
        time = self.world.time
        if self.setup.slides:
            # A new map at another position tells the terrain that the ground slides.
            geometry = replace(self.heightmap.geometry, origin=(*self.setup.offset(time), 0.0))
            self.world.terrain.put("", HeightMap(ready, geometry=geometry, time=time, motion=self.heightmap.motion))
        else:
            self.heightmap.replace(ready, time=time)

    def close(self) -> None:
        self.world.close()


class SmartMesh(WorldGround, BulletEngine):
    """Bodies. A step is PyBullet's own ``stepSimulation``, unless the report's colliders follow them.

    ``attached``: the bodies are made as PyBullet makes them and attached to the ground, not spawned by `World`.
    """

    def __init__(
        self, setup: Setup, *, attached: bool = False, report: ReportConfig | None = None, **options: Any
    ) -> None:
        super().__init__(setup, report=report, **options)
        self._is_report = report is not None
        if attached:
            self.uids = [self.add(body) for body in setup.bodies]
            for uid in self.uids:
                self.world.ground.attach(uid)
        else:
            for index, body in enumerate(setup.bodies):
                self.world.spawn(f"body_{index}", body.shape, body.mass, body.state)
            self.uids = [body.uid for body in self.world.bodies.values()]
        for uid, body in zip(self.uids, setup.bodies, strict=True):
            self.client.changeDynamics(uid, -1, lateralFriction=body.friction, restitution=body.restitution)

    def step(self) -> None:
        if self._is_report:
            self.world.ground.step(self.world.time, self.setup.dt)
        else:
            self.client.stepSimulation()
        self.world.time += self.setup.dt
