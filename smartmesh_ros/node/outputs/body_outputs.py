"""Outputs of bodies and robots: states and contacts, which are serialised to bytes, joint states, odometry, wrenches,
and the latched descriptions of all bodies."""

from __future__ import annotations

import array
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import (
    BodyDescription,
    BodyDescriptionArray,
    Contact,
    ContactArray,
    ContactWrench,
    ContactWrenchArray,
    TrackedBody,
    TrackedBodyArray,
)
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.quaternions import conjugate, quaternion_of, rotate
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.outputs.cdr import ArrayMessage, by_length, stamp_fields, text_rows
from smartmesh_ros.node.services.files import urdf_text
from smartmesh_ros.node.session import Session
from smartmesh_ros.terrain.deck import Frame
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.state_table import StateTable
from smartmesh_ros.world.world import World


class BodyStates:
    """``~/body_states``: every simulated body."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, states: StateTable, physics: PhysicsConfig, ahead: float) -> bytes:
        """Return the TrackedBodyArray; ``ahead``: lead of the states' time over the header's stamp [s]."""
        message = self._message
        message.start(
            (header.frame_id, physics.rate, physics.gravity),
            lambda: TrackedBodyArray(header=header, rate=physics.rate, gravity=np.array(physics.gravity, np.float32)),
            {**stamp_fields(header), "ahead": ahead},
        )
        # Bodies stay in order of spawning; consecutive ones with names of equal length form a group.
        lengths = np.array([len(name.encode()) for name in states.names], np.int64)
        starts = np.flatnonzero(np.diff(lengths, prepend=-1))
        ends = np.append(starts[1:], len(lengths))[: len(starts)]
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            length = int(lengths[start])
            fields: dict[str, Any] = {
                "id": text_rows(states.names[start:end]),
                "radius": states.radii[start:end],
                "shape": states.kinds[start:end],
                "dimensions": states.dimensions[start:end],
                "centre": states.centres[start:end],
                "mass": states.masses[start:end],
            }
            for column, path in enumerate(_STATE_FIELDS):
                fields[path] = states.numbers[start:end, column]
            message.add(length, lambda: TrackedBody(id="x" * length), end - start, fields)  # noqa: B023  # called at once
        return message.finish()


class Contacts:
    """``~/contacts``: contacts between bodies and the ground."""

    def __init__(self) -> None:
        self._message = ArrayMessage()

    def write(self, header: Header, contacts: list[GroundContact]) -> bytes:
        """Return the ContactArray."""
        message = self._message
        message.start(header.frame_id, lambda: ContactArray(header=header), stamp_fields(header))
        for part, texts in by_length([contact.body for contact in contacts]):
            group = [contacts[index] for index in part.tolist()]
            numbers = np.array([(*c.position, *c.normal, c.depth, c.normal_force) for c in group])
            fields: dict[str, Any] = {path: numbers[:, column] for column, path in enumerate(_CONTACT_FIELDS)}
            fields["body_id"] = text_rows(texts)
            length = len(texts[0].encode())
            message.add(length, lambda: Contact(body_id="x" * length), len(group), fields)  # noqa: B023
        return message.finish()


_CONTACT_FIELDS = (
    *(f"position.{axis}" for axis in "xyz"),
    *(f"normal.{axis}" for axis in "xyz"),
    "depth",
    "normal_force",
)
_STATE_FIELDS = (
    *(f"pose.position.{axis}" for axis in "xyz"),
    *(f"pose.orientation.{axis}" for axis in "xyzw"),
    *(f"twist.linear.{axis}" for axis in "xyz"),
    *(f"twist.angular.{axis}" for axis in "xyz"),
)


def joint_states(header: Header, world: World, prefixes: dict[str, str]) -> JointState:
    """Return the states of all joints of the robots in ``prefixes``, which maps robots to the prefixes of their
    names."""
    found = [(prefix + joint.name, joint) for robot, prefix in prefixes.items() for joint in world.joints(robot)]
    return JointState(
        header=Header(stamp=header.stamp),  # joints have no frame
        name=[name for name, _ in found],
        position=[joint.position for _, joint in found],
        velocity=[joint.velocity for _, joint in found],
        effort=[joint.effort for _, joint in found],
    )


def odometry(header: Header, world: World, robot: str, prefix: str) -> Odometry:
    """Return the true pose of a robot's root link in the terrain's frame, and its twist in the frame of that link,
    ``<prefix><link>``."""
    state = world.base_state(robot)
    back = conjugate(state.orientation)
    root = world.client.getBodyInfo(world.bodies[robot].uid)[0].decode()
    message = Odometry(header=header, child_frame_id=prefix + root)
    message.pose.pose = pose_message(state)
    message.twist.twist = Twist(
        linear=_vector(rotate(back, state.linear)), angular=_vector(rotate(back, state.angular))
    )
    return message


def deck_odometry(header: Header, name: str, frame: Frame) -> Odometry:
    """Return the pose of a deck's frame in the terrain's, and its twist in its own, which has the deck's name."""
    message = Odometry(header=header, child_frame_id=name)
    message.pose.pose = pose_message(BodyState(tuple(frame.position.tolist()), quaternion_of(frame.rotation)))
    linear, angular = ((vector @ frame.rotation).tolist() for vector in (frame.velocity, frame.spin))
    message.twist.twist = Twist(linear=_vector(linear), angular=_vector(angular))
    return message


def contact_wrenches(header: Header, world: World) -> ContactWrenchArray:
    """Return the wrench of the ground on every simulated body and link."""
    wrenches = []
    for found in world.wrenches():
        x, y, z = found.centre.tolist()
        wrench = Wrench(force=_vector(found.force.tolist()), torque=_vector(found.torque.tolist()))
        wrenches.append(ContactWrench(body_id=found.body, centre=Point(x=x, y=y, z=z), wrench=wrench))
    return ContactWrenchArray(header=header, wrenches=wrenches)


def pose_message(state: BodyState) -> Pose:
    """Return the pose of a state."""
    x, y, z = state.position
    qx, qy, qz, qw = state.orientation
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def twist_message(state: BodyState) -> Twist:
    """Return the twist of a state, in the terrain's frame."""
    return Twist(linear=_vector(state.linear), angular=_vector(state.angular))


def _vector(values: tuple[float, float, float] | list[float]) -> Vector3:
    x, y, z = values
    return Vector3(x=float(x), y=float(y), z=float(z))


# Period of the check for added and removed bodies [s].
PERIOD = 0.1
# Late subscribers receive the last message.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class BodyDescriptions:
    """Publishes all descriptions when a body is added or removed, while the topic has subscribers."""

    def __init__(self, session: Session) -> None:
        self._session = session
        session.topics.publish("~/body_descriptions")
        self.publisher = session.node.create_publisher(BodyDescriptionArray, "~/body_descriptions", LATCHED)
        self._described: list[Body] | None = None  # in the last message; None = no subscribers
        self._due = 0.0

    def publish(self) -> None:
        """Publishes the descriptions if they are due and have changed."""
        now = self._session.clock.steady()
        if now < self._due:
            return
        self._due = now + PERIOD
        if not self.publisher.get_subscription_count():
            self._described = None
            return
        bodies = [body for body in self._session.world.bodies.values() if not body.owner]
        if bodies != self._described:
            header = Header(stamp=self._session.stamp_now(), frame_id=self._session.frame_id)
            self.publisher.publish(BodyDescriptionArray(header=header, bodies=[description(body) for body in bodies]))
            self._described = bodies


def description(body: Body) -> BodyDescription:
    """Return the description of a body."""
    made = BodyDescription(id=body.name, tracked=body.tracked)
    if body.urdf is not None:
        made.shape = BodyDescription.ROBOT
        with suppress(InputError):  # the file may have been deleted since the robot was loaded
            made.urdf = urdf_text(body.urdf)
        if body.urdf != made.urdf:
            made.urdf_file = str(Path(body.urdf).absolute())
        return made
    shape = body.outline
    made.shape = int(shape.kind)
    made.dimensions = array.array("d", list(shape.dimensions.values()))
    return made
