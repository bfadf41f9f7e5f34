"""Robots in this package's `World`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.bullet import bullet_contacts
from studies.engines.engine import Contacts, Links
from studies.engines.smartmesh import WorldGround
from studies.robots.engine import FRICTION, SERVO, RobotEngine, RobotSetup


class WorldRobots(WorldGround, RobotEngine):
    """`World` as it is."""

    def __init__(self, setup: RobotSetup, **options: Any) -> None:
        super().__init__(setup, **options)
        self._robot = setup.robot
        for index, start in enumerate(setup.starts.tolist()):
            self._add(f"robot_{index}", setup.text, start, setup.speed)
        bodies = list(self.world.bodies.values())
        self.names = tuple(bodies[0].links.values())  # the root link first, if it has shapes
        self._links = [link for link in bodies[0].links if link >= 0]
        self._has_base = -1 in bodies[0].links
        self.uids = [body.uid for body in bodies]
        self._all = list(range(self.client.getNumJoints(self.uids[0])))
        masses = np.array([self.client.getDynamicsInfo(self.uids[0], link)[0] for link in [-1, *self._all]])
        self._shares = masses / masses.sum()

    def _add(self, name: str, text: str, start: list[float], speed: float) -> None:
        world, client, robot = self.world, self.client, self._robot
        world.spawn_robot(name, text, BodyState((start[0], start[1], start[2])))
        body = world.bodies[name]
        # World places the centre of mass of the root link, and `start` is that of its frame.
        offset = client.getDynamicsInfo(body.uid, -1)[3]
        place = [a + b for a, b in zip(start, offset, strict=True)]
        client.resetBasePositionAndOrientation(body.uid, place, (0.0, 0.0, 0.0, 1.0))
        for link in range(-1, client.getNumJoints(body.uid)):
            client.changeDynamics(body.uid, link, lateralFriction=FRICTION, rollingFriction=0.0, spinningFriction=0.0)
        for joint, position in robot.stance.items():
            client.resetJointState(body.uid, body.joints[joint], position, 0.0)
            self._servo(body, joint, position)
        for joint in robot.wheels:
            client.setJointMotorControl2(
                body.uid, body.joints[joint], pb.VELOCITY_CONTROL, targetVelocity=speed, force=robot.torque
            )
        world.ground.wake(body.uid)

    def _servo(self, body: Any, joint: str, position: float) -> None:
        self.client.setJointMotorControl2(
            body.uid, body.joints[joint], pb.POSITION_CONTROL, targetPosition=position, targetVelocity=0.0,
            force=self._robot.torque, positionGain=self.setup.dt / SERVO, velocityGain=1.0,
        )  # fmt: skip

    def hold(self, positions: Mapping[str, float]) -> None:
        for body in self.world.bodies.values():
            for joint, position in positions.items():
                self._servo(body, joint, position)

    def step(self) -> None:
        self.world.step()

    def links(self) -> Links:
        poses = []
        for uid in self.uids:
            if self._has_base:
                poses.append(self._base_frame(uid))
            states = self.client.getLinkStates(uid, self._links, computeForwardKinematics=1)
            poses += [(*state[4], *state[5]) for state in states]
        found = np.array(poses).reshape(len(self.uids), len(self.names), 7)
        return Links(found[..., :3], found[..., 3:])

    def _base_frame(self, uid: int) -> tuple[float, ...]:
        """Return the pose of the root link's frame."""
        client = self.client
        inverse = client.invertTransform(*client.getDynamicsInfo(uid, -1)[3:5])
        position, orientation = client.multiplyTransforms(*client.getBasePositionAndOrientation(uid), *inverse)
        return (*position, *orientation)

    def velocities(self) -> FloatArray:
        client, found = self.client, []
        for uid in self.uids:
            states = client.getLinkStates(uid, self._all, computeLinkVelocity=1)
            linear = np.array([client.getBaseVelocity(uid)[0], *(state[6] for state in states)])
            found.append(self._shares @ linear)
        return np.array(found)

    def contacts(self) -> Contacts:
        parts = {(uid, link): index for index, uid in enumerate(self.uids) for link in (-1, *self._all)}
        return bullet_contacts(self.client, parts, self.setup.dt)
