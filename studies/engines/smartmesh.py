"""This package as an engine: a small velocity-carrying patch under each body."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.world.world import World, WorldConfig
from studies.engines.bullet import base_parts, body_arrays, bullet_contacts
from studies.engines.engine import Contacts, Engine, EngineBody, Setup


@dataclass(frozen=True, kw_only=True)
class SmartMeshOptions:
    """Configurations of patches, of motion between maps, and of physics; the scene overrides step rate and gravity.
    ``attached``: the bodies are made as PyBullet makes them and attached to the ground, not spawned by `World`."""

    patch: PatchConfig = field(default_factory=PatchConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    attached: bool = False


class SmartMesh(Engine):
    """`World` on a `HeightMap`. `set_ground` prepares the patches; in steps without a new map, `step` does."""

    name: ClassVar[str] = "smartmesh"

    def __init__(self, setup: Setup, options: SmartMeshOptions | None = None) -> None:
        chosen = options or SmartMeshOptions()
        self.heightmap = HeightMap(setup.heights, resolution=setup.resolution, motion=chosen.motion)
        physics = replace(chosen.physics, rate=1.0 / setup.dt, gravity=setup.gravity)
        self.world = World(self.heightmap, WorldConfig(physics=physics, patch=chosen.patch))
        if chosen.attached:
            self._uids = [self._attach(body) for body in setup.bodies]
        else:
            for index, body in enumerate(setup.bodies):
                self.world.spawn(f"body_{index}", body.shape, body.mass, body.state)
            self._uids = [body.uid for body in self.world.bodies.values()]
        for uid, body in zip(self._uids, setup.bodies, strict=True):
            self.world.client.changeDynamics(uid, -1, lateralFriction=body.friction, restitution=body.restitution)
        self._setup = setup
        self._prepared = False

    def set_ground(self, heights: FloatArray, velocities: FloatArray | None = None) -> None:
        time = self.world.time
        if self._setup.slides:
            # A new map at another position tells the terrain that the ground slides.
            x, y = self._setup.offset(time)
            geometry = replace(self.heightmap.geometry, origin=(x, y, 0.0))
            moved = HeightMap(
                heights, geometry=geometry, time=time, velocities=velocities, motion=self.heightmap.motion
            )
            self.world.terrain.put("", moved)
        else:
            self.heightmap.replace(heights, time=time, velocities=velocities)
        self.world.prepare()
        self._prepared = True

    def step(self) -> None:
        if not self._prepared:
            self.world.prepare()
        self._prepared = False
        self.world.client.stepSimulation()
        self.world.time += self._setup.dt

    def positions(self) -> FloatArray:
        return body_arrays(self.world.client, self._uids)[0]

    def orientations(self) -> FloatArray:
        return body_arrays(self.world.client, self._uids)[1]

    def velocities(self) -> FloatArray:
        return body_arrays(self.world.client, self._uids)[2]

    def contacts(self) -> Contacts:
        return bullet_contacts(self.world.client, base_parts(self._uids), self._setup.dt)

    def _attach(self, body: EngineBody) -> int:
        client, state = self.world.client, body.state
        shape = client.createCollisionShape(**body.shape.bullet())
        uid = client.createMultiBody(body.mass, shape, basePosition=state.position, baseOrientation=state.orientation)
        client.changeDynamics(uid, -1, linearDamping=0.0, angularDamping=0.0)
        client.resetBaseVelocity(uid, state.linear, state.angular)
        self.world.ground.attach(uid)
        return int(uid)

    def close(self) -> None:
        self.world.close()
