"""Bodies that press the soil, from the messages of a terrain_collider."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pybullet as pb
from pybullet_utils.bullet_client import BulletClient
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, TrackedBodyArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.shapes import SHAPES, shape_of
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.inputs.conversions import state_from
from smartmesh_ros.patches.shapes import ShapeKind
from smartmesh_ros.soil.bodies import BulletBodies, GivenBodies, ManyBodies
from smartmesh_ros.world.bodies import Body, BodyFactory
from smartmesh_ros.world.robots.prepared import prepare_robot


class MessageBodies:
    """Shapes and states of bodies, and of the links of robots.

    Bodies come from ``~/body_states``. Links of robots are those of a copy of the robot in a PyBullet world that is
    never stepped: its description comes from ``~/body_descriptions``, its base from ``~/body_states``, and its joints
    from ``~/joint_states``.
    """

    def __init__(self) -> None:
        self._given = GivenBodies()
        self._client: Any = None
        self._robots: dict[str, Body] = {}
        self._described: dict[str, str] = {}
        self._links: BulletBodies | None = None

    def take_descriptions(self, message: BodyDescriptionArray) -> list[InputError]:
        """Take the robots of a message; return what is wrong with those that do not load, which press nothing."""
        wanted = {body.id: body for body in message.bodies if body.shape == BodyDescription.ROBOT}
        for name in [name for name in self._robots if name not in wanted or wanted[name].urdf != self._described[name]]:
            self._client.removeBody(self._robots.pop(name).uid)
        problems = []
        for name, body in wanted.items():
            if name not in self._robots:
                self._described[name] = body.urdf
                try:
                    self._load(name, body)
                except InputError as error:
                    problems.append(InputError(error.reason, f"robot {name!r} presses no soil: {error}"))
        return problems

    def take_states(self, message: TrackedBodyArray) -> None:
        """Take the states of all bodies."""
        for body in message.bodies:
            state = state_from(body.pose, body.twist)
            if body.id in self._robots:
                self._place(self._robots[body.id], state)
            elif body.shape in SHAPES:
                shape = shape_of(ShapeKind(body.shape), body.dimensions.tolist(), body.centre.tolist())
                self._given.put(
                    body.id, shape.body_shape, (*state.position, *state.orientation, *state.linear, *state.angular)
                )
        self._given.keep(body.id for body in message.bodies)

    def take_joints(self, positions: Mapping[str, float], velocities: Mapping[str, float]) -> None:
        """Take the positions [rad, m] and velocities of joints, named ``<robot>/<joint>``, or ``<joint>`` for the robot
        without prefix."""
        for name, robot in self._robots.items():
            for joint, index in robot.joints.items():
                key = f"{name}/{joint}" if f"{name}/{joint}" in positions else joint
                if key in positions:
                    self._client.resetJointState(robot.uid, index, positions[key], velocities.get(key, 0.0))

    def read(self, names: list[str]) -> ManyBodies:
        """Return bodies and links by name."""
        given = self._given.read(names)
        if self._links is None:
            return given
        links = self._links.read(names)
        shapes = [shape or link for shape, link in zip(given.shapes, links.shapes, strict=True)]
        return ManyBodies(shapes, given.states + links.states)

    def set_grip(self, name: str, grip: float) -> None:
        """Do nothing: friction belongs to the collider's node, which has no topic for it."""

    def close(self) -> None:
        """Close the PyBullet world of the robots."""
        if self._client is not None:
            self._client.disconnect()

    def _load(self, name: str, body: BodyDescription) -> None:
        if self._client is None:
            self._client = BulletClient(pb.DIRECT)
        prepared = prepare_robot(body.urdf_file or body.urdf)
        made = BodyFactory(self._client, PhysicsConfig()).robot(name, prepared, BodyState())
        self._robots[name] = made
        self._links = BulletBodies(self._client)
        for robot in self._robots.values():
            for link, part in robot.links.items():
                try:
                    self._links.add(f"{robot.name}/{part}", robot.uid, link)
                except InputError:
                    continue  # a mesh: its contacts are refused by name

    def _place(self, robot: Body, state: BodyState) -> None:
        self._client.resetBasePositionAndOrientation(robot.uid, state.position, state.orientation)
        self._client.resetBaseVelocity(robot.uid, state.linear, state.angular)
