"""Shapes of tracked bodies, by message, by parameter, and of robots with their joints."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray

from smartmesh_ros import Box, Cylinder, Sphere
from smartmesh_ros.tools.testing import pose_message
from tests.node.shared import fed, stamped
from tests.world.test_tracked_shapes import ARM


def test_shapes_come_from_the_message_or_else_from_the_parameter() -> None:
    entries = ["{body: crate, shape: box, size: [1, 0.5, 0.5]}", "{body: drum, shape: cylinder, size: [0.4, 0.2]}"]
    with fed({"bodies.shapes": entries, "bodies.poses": ["drum=/drum"], "frame_id": "map"}) as node:
        bodies = [TrackedBody(id="crate"), TrackedBody(id="ball", radius=0.2)]
        node.give("tracked_bodies", stamped(node, TrackedBodyArray(bodies=bodies)))
        node.give("/drum", stamped(node, PoseStamped()))
        shapes = {name: body.shape for name, body in node.world.bodies.items()}
        assert shapes["crate"] == Box(1.0, 0.5, 0.5)
        assert shapes["drum"] == Cylinder(height=0.4, radius=0.2)
        assert isinstance(shapes["ball"], Sphere)
        bodies = [TrackedBody(id="crate", shape=TrackedBody.SHAPE_BOX, dimensions=np.array([2, 2, 2], np.float32))]
        node.give("tracked_bodies", stamped(node, TrackedBodyArray(bodies=bodies)))
        assert node.world.bodies["crate"].shape == Box(2.0, 2.0, 2.0)
        flat = TrackedBody(id="a", shape=1, dimensions=np.array([1, 0, 1], np.float32))
        for reason, body in (("shape", TrackedBody(id="a", shape=7)), ("geometry", flat)):
            node.require_refused("tracked_bodies", [(reason, stamped(node, TrackedBodyArray(bodies=[body])))])


def test_a_tracked_robot_follows_its_root_and_its_joints(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    parameters = {"bodies.shapes": [f"{{body: rig, urdf: {file}}}"], "bodies.odometry": ["rig=/rig"], "frame_id": "map"}
    with fed(parameters) as node:
        joints = JointState(name=["rig/yaw", "reach", "elsewhere"], position=[0.5, 0.2, 1.0], velocity=[2.0, 0.0, 9.0])
        node.give("tracked_joint_states", joints)
        message = stamped(node, Odometry())
        message.pose.pose = pose_message((1.0, 0.0, 0.5))
        message.twist.twist = Twist(linear=Vector3(x=0.3))
        node.give("/rig", message, 0)
        assert node.world.bodies.keys() == {"rig.base", "rig.arm", "rig.hand"}
        hand = node.world.state("rig.hand")
        out = np.array([math.cos(0.5), math.sin(0.5), 0.0])
        np.testing.assert_allclose(hand.position, (1.0, 0.0, 0.9) + 1.25 * out, atol=1e-4)
        np.testing.assert_allclose(hand.linear, (0.3, 0.0, 0.0) + 2.5 * np.array([-out[1], out[0], 0.0]), atol=1e-4)
        bad = [("length", JointState(name=["yaw"])), ("non_finite", JointState(name=["yaw"], position=[math.nan]))]
        node.require_refused("tracked_joint_states", bad)
