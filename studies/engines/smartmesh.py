"""This package as an engine of bodies and of robots: contacts from the map, or the report's colliders."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros import BodyState, HeightMap, MotionConfig, PhysicsConfig, WorldConfig
from smartmesh_ros.ground.limits import FARTHEST_BODY
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.settings import FallConfig
from studies.engines.bullet import BulletEngine, bullet_contacts
from studies.engines.engine import Contacts, GroundSetup, Links, Setup, Simulation
from studies.report.config import ReportConfig
from studies.report.ground import world_on
from studies.robots.robot import FRICTION, SERVO, RobotEngine, RobotSetup

# What falls off the ground is measured to the end, as in the other engines.
NEVER_LOST = FallConfig(depth=FARTHEST_BODY)


class WorldGround(Simulation):
    """A `World` on a `HeightMap`, with contacts from the map or from the ``report``'s colliders. The setup overrides
    step rate and gravity of ``physics``."""

    def __init__(
        self, setup: GroundSetup, *, report: ReportConfig | None = None, motion: MotionConfig | None = None,
        physics: PhysicsConfig | None = None,
    ) -> None:  # fmt: skip
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


class WorldRobots(WorldGround, RobotEngine):
    """`World` as it is."""

    def __init__(self, setup: RobotSetup, **options: Any) -> None:
        super().__init__(setup, **options)
        self._robot = setup.robot
        for index, start in enumerate(setup.starts.tolist()):
            self.world.spawn_robot(f"robot_{index}", setup.text, BodyState(tuple(start)))
        bodies = list(self.world.bodies.values())
        for body, start in zip(bodies, setup.starts, strict=True):
            self._place(body, start, setup.speed)
        self.hold(setup.robot.stance)
        self.names = tuple(bodies[0].links.values())  # the root link first, if it has shapes
        self._links = [link for link in bodies[0].links if link >= 0]
        self._has_base = -1 in bodies[0].links
        self.uids = [body.uid for body in bodies]
        self._all = list(range(self.client.getNumJoints(self.uids[0])))
        masses = np.array([self.client.getDynamicsInfo(self.uids[0], link)[0] for link in [-1, *self._all]])
        self._shares = masses / masses.sum()

    def _place(self, body: Any, start: FloatArray, speed: float) -> None:
        """Place a robot's root frame, not its centre of mass as `World` does; wheels turn at a ``speed`` [rad/s]."""
        client, robot = self.client, self._robot
        place = start + client.getDynamicsInfo(body.uid, -1)[3]
        client.resetBasePositionAndOrientation(body.uid, place.tolist(), (0.0, 0.0, 0.0, 1.0))
        for link in range(-1, client.getNumJoints(body.uid)):
            client.changeDynamics(body.uid, link, lateralFriction=FRICTION, rollingFriction=0.0, spinningFriction=0.0)
        for joint, position in robot.stance.items():
            client.resetJointState(body.uid, body.joints[joint], position, 0.0)
        for joint in robot.wheels:
            client.setJointMotorControl2(
                body.uid, body.joints[joint], pb.VELOCITY_CONTROL, targetVelocity=speed, force=robot.torque
            )
        self.world.ground.wake(body.uid)

    def hold(self, positions: Mapping[str, float]) -> None:
        for body in self.world.bodies.values():
            for joint, position in positions.items():
                self.client.setJointMotorControl2(
                    body.uid, body.joints[joint], pb.POSITION_CONTROL, targetPosition=position, targetVelocity=0.0,
                    force=self._robot.torque, positionGain=self.setup.dt / SERVO, velocityGain=1.0,
                )  # fmt: skip

    def step(self) -> None:
        self.world.step()

    def links(self) -> Links:
        client, poses = self.client, []
        for uid in self.uids:
            if self._has_base:
                inverse = client.invertTransform(*client.getDynamicsInfo(uid, -1)[3:5])
                poses.append(client.multiplyTransforms(*client.getBasePositionAndOrientation(uid), *inverse))
            poses += [state[4:6] for state in client.getLinkStates(uid, self._links, computeForwardKinematics=1)]
        positions, orientations = (
            np.array(part).reshape(len(self.uids), len(self.names), -1) for part in zip(*poses, strict=True)
        )
        return Links(positions, orientations)

    def velocities(self) -> FloatArray:
        client, found = self.client, []
        for uid in self.uids:
            states = client.getLinkStates(uid, self._all, computeLinkVelocity=1)
            found.append(self._shares @ np.array([client.getBaseVelocity(uid)[0], *(state[6] for state in states)]))
        return np.array(found)

    def contacts(self) -> Contacts:
        parts = {(uid, link): index for index, uid in enumerate(self.uids) for link in (-1, *self._all)}
        return bullet_contacts(self.client, parts, self.setup.dt)
