"""Conversion of the node's messages to plain values."""

from __future__ import annotations

from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import BodyDescriptionArray, ContactArray, TrackedBodyArray

from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.tools.view.sight import NO_CONTACTS, Appearance, Contacts, Pose, Sight


def pose_of(message: Any) -> Pose:
    """Convert a geometry_msgs/Pose."""
    p, q = message.position, message.orientation
    return Pose((p.x, p.y, p.z), (q.w, q.x, q.y, q.z))


def poses_of(states: Any) -> dict[str, Pose]:
    """Return the poses of a TrackedBodyArray by body."""
    return {body.id: pose_of(body.pose) for body in states.bodies}


def asleep_in(states: Any) -> frozenset[str]:
    """Return the bodies of the node's TrackedBodyArray that sleep: only their velocities are exactly zero."""
    names = []
    for body in states.bodies:
        v, w = body.twist.linear, body.twist.angular
        if not (v.x or v.y or v.z or w.x or w.y or w.z):
            names.append(body.id)
    return frozenset(names)


def appearances_of(descriptions: Any) -> dict[str, Appearance]:
    """Return the appearances of a BodyDescriptionArray by body."""
    return {
        body.id: Appearance(body.shape, tuple(body.dimensions), body.tracked, body.urdf, body.urdf_file)
        for body in descriptions.bodies
    }


def joints_of(message: Any) -> dict[str, float]:
    """Return the positions of a JointState by joint."""
    return dict(zip(message.name, message.position, strict=False))


def contacts_of(message: Any) -> Contacts:
    """Convert a ContactArray."""
    rows = [
        (c.position.x, c.position.y, c.position.z, c.normal.x, c.normal.y, c.normal.z, c.normal_force)
        for c in message.contacts
    ]
    table = np.array(rows).reshape(-1, 7)
    return Contacts(table[:, :3], table[:, 3:6], table[:, 6]) if rows else NO_CONTACTS


# Types of the node's topics that `take` reads. ~/odometry has a message for each robot.
KINDS = {
    "body_descriptions": BodyDescriptionArray,
    "body_states": TrackedBodyArray,
    "tracked_bodies": TrackedBodyArray,
    "joint_states": JointState,
    "odometry": Odometry,
    "contacts": ContactArray,
}


def take(sight: Sight, topic: str, data: bytes) -> None:
    """Update a sight with a message of a topic of `KINDS`."""
    message = deserialize_message(data, KINDS[topic])
    if topic == "body_descriptions":
        sight.appearances = appearances_of(message)
        sight.poses = {name: pose for name, pose in sight.poses.items() if name in sight.appearances}
    elif topic in ("body_states", "tracked_bodies"):
        sight.poses.update(poses_of(message))
        if topic == "body_states":
            sight.asleep = asleep_in(message)
    elif topic == "joint_states":
        sight.joints = joints_of(message)
    elif topic == "odometry":
        sight.bases[message.child_frame_id] = pose_of(message.pose.pose)
    else:
        sight.contacts = contacts_of(message)


def is_incremental(patches: bytes) -> bool:
    """Return True if the bytes of a ColliderPatchArray contain only changed patches."""
    reader = CdrReader(patches)
    reader.number("i"), reader.number("I"), reader.text()
    return bool(reader.number("B"))


def warnings_of(message: Any, node: str) -> list[str]:
    """Return the warnings of a node's diagnostics and its counts of refusals, as texts."""
    found = []
    for status in message.status:
        task = status.name.removeprefix(f"{node.strip('/')}: ")
        if task == status.name:
            continue  # status of another node
        if status.level not in (DiagnosticStatus.OK, b"\x00"):
            found.append(f"{task}: {status.message}")
        found += [
            f"{pair.value} x {pair.key.removeprefix('refused, ').replace('_', ' ')}"
            for pair in status.values
            if pair.key.startswith("refused, ")
        ]
    return found


def is_paused(message: Any, node: str) -> bool | None:
    """Return True if diagnostics report a node's physics as paused; None if they are another node's."""
    for status in message.status:
        if status.name == f"{node.strip('/')}: physics":
            return any(pair.key == "paused" and pair.value == "True" for pair in status.values)
    return None
