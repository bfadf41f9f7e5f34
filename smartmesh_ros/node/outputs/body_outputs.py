"""Messages of bodies and robots: states and contacts, which are serialised to bytes, joint states, odometry, wrenches
and descriptions."""

from __future__ import annotations

import array
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import (
    BodyDescription,
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
from smartmesh_ros.ground.quaternions import conjugate, rotate
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node.outputs.cdr import ArrayMessage, fields_of, stamp_fields, xyz
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.contacts import GroundContact
from smartmesh_ros.world.robots.description import urdf_text
from smartmesh_ros.world.state_table import StateTable
from smartmesh_ros.world.world import World


def body_states(
    message: ArrayMessage, header: Header, states: StateTable, physics: PhysicsConfig, ahead: float
) -> bytes:
    """Return the TrackedBodyArray of bodies; ``ahead``: lead of the states' time over the header's stamp [s]."""
    settings = {"rate": physics.rate, "gravity": np.array([physics.gravity])}
    start = {**stamp_fields(header), "ahead": ahead, **settings}
    message.start(header.frame_id, lambda: TrackedBodyArray(header=header), start)
    fields = {
        "radius": states.radii, "shape": states.kinds, "dimensions": states.dimensions, "centre": states.centres,
        "mass": states.masses, **dict(zip(_STATE_FIELDS, states.numbers.T, strict=True)),
    }  # fmt: skip
    message.add_named(lambda name: TrackedBody(id=name), {"id": states.names}, fields, ordered=True)
    return message.finish()


def contact_array(message: ArrayMessage, header: Header, contacts: list[GroundContact]) -> bytes:
    message.start(header.frame_id, lambda: ContactArray(header=header), stamp_fields(header))
    numbers = np.array([(*c.position, *c.normal, c.depth, c.normal_force) for c in contacts]).reshape(-1, 8)
    names, fields = [contact.body for contact in contacts], dict(zip(_CONTACT_FIELDS, numbers.T, strict=True))
    message.add_named(lambda name: Contact(body_id=name), {"body_id": names}, fields)
    return message.finish()


_CONTACT_FIELDS = (*fields_of("position"), *fields_of("normal"), "depth", "normal_force")
_STATE_FIELDS = (
    *fields_of("pose.position"),
    *fields_of("pose.orientation", "xyzw"),
    *fields_of("twist.linear"),
    *fields_of("twist.angular"),
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


def odometry(header: Header, child: str, state: BodyState) -> Odometry:
    """Return the pose of a frame ``child`` in the frame of the header, and its twist in its own frame, of its state."""
    back = conjugate(state.orientation)
    own = replace(state, linear=rotate(back, state.linear), angular=rotate(back, state.angular))
    message = Odometry(header=header, child_frame_id=child)
    message.pose.pose, message.twist.twist = pose_message(state), twist_message(own)
    return message


def contact_wrenches(header: Header, world: World) -> ContactWrenchArray:
    """Return the wrench of the ground on every simulated body and link."""
    wrenches = []
    for found in world.wrenches():
        wrench = Wrench(force=xyz(Vector3, found.force), torque=xyz(Vector3, found.torque))
        wrenches.append(ContactWrench(body_id=found.body, centre=xyz(Point, found.centre), wrench=wrench))
    return ContactWrenchArray(header=header, wrenches=wrenches)


def pose_message(state: BodyState) -> Pose:
    return Pose(position=xyz(Point, state.position), orientation=xyz(Quaternion, state.orientation))


def twist_message(state: BodyState) -> Twist:
    return Twist(linear=xyz(Vector3, state.linear), angular=xyz(Vector3, state.angular))


def description(body: Body) -> BodyDescription:
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
