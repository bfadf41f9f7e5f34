"""Robots, driven by their joints and reported, against mechanics."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import JointState
from smartmesh_msgs.srv import SpawnBody
from std_srvs.srv import SetBool

from smartmesh_ros import BodyState
from smartmesh_ros.scenes.tracks import robot_file
from smartmesh_ros.tools.testing import heightmap_message, pose_message
from tests.bodies import about_z
from tests.node.shared import Fed, Logged, fed, on_level
from tests.urdfs import ROVER

RADIUS = 0.15  # of the wheels [m]
WEIGHT = 14.0 * 9.81  # of the rover [N]
WHEELS = ["front_left", "front_right", "rear_left", "rear_right"]
YAW = 2.1
LASTING = {"bodies.command_timeout": 0.0}


def test_the_ground_carries_the_weight_where_the_centre_of_mass_is() -> None:
    with on_level(LASTING, keep=["contact_wrenches"]) as run:
        run.world.spawn_robot("rover", ROVER, BodyState((4.0, 4.0, 0.3), about_z(YAW)))
        run.run(2.0)
        message = run.received("contact_wrenches")[-1]
        assert message.header.frame_id == "map"
        wrenches = {found.body_id: found.wrench for found in message.wrenches}
        assert set(wrenches) == {"rover/base_link", *(f"rover/{wheel}_wheel" for wheel in WHEELS)}
        force = sum(np.array([w.force.x, w.force.y, w.force.z]) for w in wrenches.values())
        assert force == pytest.approx([0.0, 0.0, WEIGHT], abs=0.02 * WEIGHT)
        assert wrenches["rover/base_link"].force == Vector3(), "the body itself does not touch the ground"
        # Lever rule: the centre of mass lies 10 x 0.1 / 14 m ahead of the middle of axles 0.6 m apart.
        front = sum(wrenches[f"rover/front_{side}_wheel"].force.z for side in ("left", "right"))
        assert front / WEIGHT == pytest.approx(0.5 + (10.0 * 0.1 / 14.0) / 0.6, rel=0.03)
        # Driven wheels, held back: the ground's torque on a wheel is minus its friction times the radius.
        run.give("joint_commands", JointState(name=WHEELS, effort=[1.0] * 4))
        run.run(2.05)
        for found in run.received("contact_wrenches")[-1].wrenches:
            if found.body_id != "rover/base_link":
                f, t = found.wrench.force, found.wrench.torque
                ahead = f.x * math.cos(YAW) + f.y * math.sin(YAW)
                about_axle = -t.x * math.sin(YAW) + t.y * math.cos(YAW)
                assert ahead > 0.5
                assert about_axle == pytest.approx(-RADIUS * ahead, rel=0.05)


def test_the_twist_of_odometry_is_in_the_frame_of_the_turned_base() -> None:
    """Its linear part is that of the base's frame, which is not where the centre of mass is."""
    twist = Twist(linear=Vector3(x=1.0), angular=Vector3(z=0.5))
    pose = pose_message((1.0, 2.0, 3.0), 0.5 * math.pi)  # faces +y
    asked = SpawnBody.Request(id="rover", urdf=Path(ROVER).read_text(), pose=pose, twist=twist)
    with on_level(None, ("pause", 0.0, SetBool.Request(data=True)), keep=["odometry"]) as run:
        run.run(0.1)
        assert run.call("spawn_body", asked).success
        run.run(0.2)
        found = run.received("odometry")[-1]
        assert (found.header.frame_id, found.child_frame_id) == ("map", "base_link")
        linear, angular = found.twist.twist.linear, found.twist.twist.angular
        # In the base's frame v = (0, -1, 0), w = (0, 0, 0.5), and its origin lies at (-0.1, 0, 0.05) from the centre.
        assert (linear.x, linear.y, linear.z) == pytest.approx((0.0, -1.0 - 0.5 * 0.1, 0.0), abs=1e-6)
        assert (angular.x, angular.y, angular.z) == pytest.approx((0.0, 0.0, 0.5), abs=1e-6)
        p = found.pose.pose.position
        assert (p.x, p.y, p.z) == pytest.approx((1.0, 2.0 - 0.1, 3.0 + 0.05), abs=1e-6)


@contextmanager
def driven(urdf: str, names: list[str], **parameters: float) -> Iterator[tuple[Fed, Callable[..., None]]]:
    """A node with a robot on level ground, and what gives it commands for these joints that must be refused."""
    with fed(parameters) as node:
        node.give("heightmap", heightmap_message(np.zeros((101, 101)), stamp=node.now()))
        node.world.spawn_robot("robot", urdf, BodyState((4.0, 4.0, 0.0)), on_ground=True)

        def refuse(*bad: tuple[str, dict[str, Any]]) -> None:
            cases = [(reason, JointState(**{"name": names, **fields})) for reason, fields in bad]
            node.require_refused("joint_commands", cases)

        yield node, refuse


def test_bad_commands_are_refused_whole_and_the_last_good_one_goes_on(logged: Logged) -> None:
    with driven(ROVER, WHEELS, **LASTING) as (node, refuse):
        node.give("joint_commands", JointState(name=WHEELS, velocity=[4.0] * 4))
        refuse(
            ("unknown_joint", {"name": [*WHEELS[:3], "rear_rihgt"], "velocity": [0.0] * 4}),
            ("unknown_joint", {"name": ["crane/front_left"], "velocity": [0.0]}),
            ("duplicate_id", {"name": ["rear_left", "robot/rear_left"], "velocity": [0.0] * 2}),
            ("length", {"velocity": [0.0] * 4, "effort": [1.0]}),
            ("length", {"name": [], "velocity": []}),
            ("non_finite", {"velocity": [0.0, 0.0, 0.0, -math.inf]}),
            ("joint_command", {"velocity": [0.0] * 4, "effort": [1.0, 1.0, 1.0, -1.0]}),
        )
        said = logged()
        assert "1 of 4 joints are unknown: 'rear_rihgt'; did you mean 'rear_right'?" in said
        assert "robot/front_left, robot/front_right" in said
        node.run(240)
        assert [found.velocity for found in node.world.joints("robot")] == pytest.approx([4.0] * 4, rel=0.01)
        free = JointState(name=[f"robot/{wheel}" for wheel in WHEELS])  # nothing but names
        node.give("joint_commands", free)
        assert [found.effort for found in node.world.joints("robot")] == [0.0] * 4


def test_tracks_are_driven_by_joint_commands_under_their_names() -> None:
    """Before and after a reset; joint states, which tell only of joints, do not tell of them."""
    tracks = ["left_track", "right_track"]
    with driven(str(robot_file()), tracks, **LASTING) as (node, refuse):
        node.give("joint_commands", JointState(name=tracks, velocity=[0.3, 0.5]))
        refuse(
            ("unknown_joint", {"name": ["left_track", "middle_track"], "velocity": [1.0, 1.0]}),
            ("joint_command", {"velocity": [1.0, math.nan], "position": [math.nan, 1.0]}),
            ("joint_command", {"velocity": [1.0, 1.0], "effort": [math.nan, 1.0]}),
            ("joint_command", {}),
            ("duplicate_id", {"name": ["left_track", "robot/left_track"], "velocity": [1.0, 1.0]}),
        )
        for _ in range(2):
            node.run(120)
            state = node.world.state("robot")
            assert math.hypot(*state.linear) == pytest.approx(0.4, rel=0.03)
            assert state.angular[2] == pytest.approx(0.2, rel=0.1)
            node.node.reset()
        assert not node.world.joints("robot")


def test_wheels_stop_when_their_publisher_dies(logged: Logged) -> None:
    """By default half a second of simulated time after the last velocity. Positions and renewals:
    tests/world/test_joint_dynamics.py."""
    with driven(ROVER, WHEELS) as (node, _):
        node.give("joint_commands", JointState(name=WHEELS, velocity=[4.0] * 4), steps=110)
        for speed in (4.0, 0.0):
            found = [joint.velocity for joint in node.world.joints("robot")]
            assert found == pytest.approx([speed] * 4, rel=0.05, abs=0.02)
            node.run(120)
        assert logged().count("no command came for front_left, front_right, rear_left, rear_right of 'robot'") == 1
