"""Robots over real DDS: described, driven, and reported, against mechanics."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import JointState
from smartmesh_msgs.srv import StepPhysics
from std_msgs.msg import String
from std_srvs.srv import SetBool

from smartmesh_ros import BodyState
from smartmesh_ros.scenes.tracks import robot_file
from smartmesh_ros.tools.testing import Probe, heightmap_message, pose_message
from tests.node.shared import LATCHED, Fed, changed, fed, refusals, spawn

ROVER = Path(__file__).parent.parent / "data" / "rover.urdf"
RADIUS = 0.15  # of the wheels [m]
WEIGHT = 14.0 * 9.81  # of the rover [N]
WHEELS = ["front_left", "front_right", "rear_left", "rear_right"]
SHARED = {"frame_id": "map", "bodies.urdf_folders": [str(ROVER.parent)]}
YAW = 2.1
# Of a node with the rover standing on its map.
STANDING = {
    "robot.description": str(ROVER),
    "robot.start": f"{{id: rover, xy: [4.0, 4.0], above: 0.25, yaw: {YAW}}}",
}
LASTING = {"bodies.command_timeout": 0.0}


def settle(probe: Probe) -> None:
    """A flat map, the physics paused, and the rover at rest on it."""
    assert probe.call("pause", SetBool, data=True).success
    probe.publish_map(np.zeros((101, 101)))
    probe.wait_for(lambda: probe.latest("odometry").child_frame_id == "base_link")
    step(probe, 480)


def settle_spawned(probe: Probe) -> None:
    """The same in the shared node, by a call."""
    spawn(probe, "rover", urdf=str(ROVER), pose=pose_message((4.0, 4.0, 0.3), YAW))
    settle(probe)


def step(probe: Probe, count: int) -> None:
    answer = probe.call("step", StepPhysics, steps=count)
    assert answer.success, answer.message


def command(probe: Probe, publisher: Any, taken: Callable[[JointState], bool], **fields: Any) -> None:
    """Publishes a command, and steps until it shows."""

    def shows() -> bool:
        publisher.publish(JointState(**{"name": WHEELS, **fields}))  # best effort: one may be lost
        step(probe, 1)
        return taken(probe.latest("joint_states"))

    probe.wait_for(shows)


def test_the_ground_carries_the_weight_where_the_centre_of_mass_is(shared: Probe) -> None:
    settle_spawned(shared)
    message = shared.latest("contact_wrenches")
    assert message.header.frame_id == "map"
    wrenches = {found.body_id: found for found in message.wrenches}
    assert set(wrenches) == {"rover/base_link", *(f"rover/{wheel}_wheel" for wheel in WHEELS)}
    force = sum(np.array([f.wrench.force.x, f.wrench.force.y, f.wrench.force.z]) for f in wrenches.values())
    assert force == pytest.approx([0.0, 0.0, WEIGHT], abs=0.02 * WEIGHT)
    assert wrenches["rover/base_link"].wrench.force == Vector3(), "the body itself does not touch the ground"
    # Lever rule: the centre of mass lies 10 x 0.1 / 14 m ahead of the middle of axles 0.6 m apart.
    front = sum(wrenches[f"rover/front_{side}_wheel"].wrench.force.z for side in ("left", "right"))
    assert front / WEIGHT == pytest.approx(0.5 + (10.0 * 0.1 / 14.0) / 0.6, rel=0.03)
    # Driven wheels, held back: the ground's torque on a wheel is minus its friction times the radius.
    publisher = shared.publisher(JointState, "joint_commands")
    command(shared, publisher, lambda m: list(m.effort) == [1.0] * 4, effort=[1.0] * 4)
    step(shared, 6)
    for found in shared.latest("contact_wrenches").wrenches:
        if found.body_id != "rover/base_link":
            f, t = found.wrench.force, found.wrench.torque
            ahead = f.x * math.cos(YAW) + f.y * math.sin(YAW)
            about_axle = -t.x * math.sin(YAW) + t.y * math.cos(YAW)
            assert ahead > 0.5
            assert about_axle == pytest.approx(-RADIUS * ahead, rel=0.05)


def test_the_twist_of_odometry_is_in_the_frame_of_the_turned_base(shared: Probe) -> None:
    """Its linear part is that of the base's frame, which is not where the centre of mass is."""
    with changed(shared, {"physics.gravity": [0.0, 0.0, 0.0]}):
        assert shared.call("pause", SetBool, data=True).success
        twist = Twist(linear=Vector3(x=1.0), angular=Vector3(z=0.5))
        pose = pose_message((1.0, 2.0, 3.0), 0.5 * math.pi)  # faces +y
        spawn(shared, "rover", urdf=str(ROVER), pose=pose, twist=twist)
        found = shared.latest("odometry")
        assert (found.header.frame_id, found.child_frame_id) == ("map", "base_link")
        linear, angular = found.twist.twist.linear, found.twist.twist.angular
        # In the base's frame v = (0, -1, 0), w = (0, 0, 0.5), and its origin lies at (-0.1, 0, 0.05) from the centre.
        assert (linear.x, linear.y, linear.z) == pytest.approx((0.0, -1.0 - 0.5 * 0.1, 0.0), abs=1e-6)
        assert (angular.x, angular.y, angular.z) == pytest.approx((0.0, 0.0, 0.5), abs=1e-6)
        p = found.pose.pose.position
        assert (p.x, p.y, p.z) == pytest.approx((1.0, 2.0 - 0.1, 3.0 + 0.05), abs=1e-6)


def require_refused(node: Fed, names: list[str], bad: list[tuple[str, dict[str, Any]]]) -> None:
    """Gives commands to joints, each of which must be refused for its reason."""
    cases = [(reason, JointState(**{"name": names, **fields})) for reason, fields in bad]
    node.require_refused("joint_commands", cases)


def test_bad_commands_are_refused_whole_and_the_last_good_one_goes_on(
    domain: int, capfd: pytest.CaptureFixture[str]
) -> None:
    with fed(LASTING) as node:
        node.give("heightmap", heightmap_message(np.zeros((101, 101)), stamp=node.now()))
        node.world.spawn_robot("rover", ROVER.read_text(), BodyState((4.0, 4.0, 0.0)), on_ground=True)
        node.give("joint_commands", JointState(name=WHEELS, velocity=[4.0] * 4))
        bad: list[tuple[str, dict[str, Any]]] = [
            ("unknown_joint", {"name": [*WHEELS[:3], "flux"], "velocity": [0.0] * 4}),
            ("unknown_joint", {"name": ["crane/front_left"], "velocity": [0.0]}),
            ("duplicate_id", {"name": ["rear_left", "rover/rear_left"], "velocity": [0.0] * 2}),
            ("length", {"velocity": [0.0] * 3}),
            ("length", {"velocity": [0.0] * 4, "effort": [1.0]}),
            ("length", {"name": [], "velocity": []}),
            ("non_finite", {"velocity": [0.0, 0.0, 0.0, -math.inf]}),
            ("non_finite", {"position": [0.0, 0.0, 0.0, math.inf]}),
            ("joint_command", {"velocity": [0.0] * 4, "effort": [1.0, 1.0, 1.0, -1.0]}),
        ]
        require_refused(node, WHEELS, bad)
        said = capfd.readouterr().err
        assert "1 of 4 joints are unknown: 'flux'" in said and "rover/front_left, rover/front_right" in said
        node.run(240)
        assert [found.velocity for found in node.world.joints("rover")] == pytest.approx([4.0] * 4, rel=0.01)
        free = JointState(name=[f"rover/{wheel}" for wheel in WHEELS])  # nothing but names
        node.give("joint_commands", free)
        assert [found.effort for found in node.world.joints("rover")] == [0.0] * 4


def test_tracks_are_driven_by_joint_commands_under_their_names(domain: int) -> None:
    """Before and after a reset; joint states, which tell only of joints, do not tell of them."""
    tracks = ["left_track", "right_track"]
    with fed(LASTING) as node:
        node.give("heightmap", heightmap_message(np.zeros((101, 101)), stamp=node.now()))
        node.world.spawn_robot("machine", robot_file().read_text(), BodyState((3.0, 5.0, 0.0)), on_ground=True)
        node.give("joint_commands", JointState(name=tracks, velocity=[0.3, 0.5]))
        bad: list[tuple[str, dict[str, Any]]] = [
            ("unknown_joint", {"name": ["left_track", "middle_track"], "velocity": [1.0, 1.0]}),
            ("non_finite", {"velocity": [1.0, math.inf]}),
            ("joint_command", {"velocity": [1.0, math.nan], "position": [math.nan, 1.0]}),
            ("joint_command", {"velocity": [1.0, 1.0], "effort": [math.nan, 1.0]}),
            ("joint_command", {}),
            ("duplicate_id", {"name": ["left_track", "machine/left_track"], "velocity": [1.0, 1.0]}),
        ]
        require_refused(node, tracks, bad)
        for _ in range(2):
            node.run(120)
            state = node.world.state("machine")
            assert math.hypot(*state.linear) == pytest.approx(0.4, rel=0.03)
            assert state.angular[2] == pytest.approx(0.2, rel=0.1)
            node.node.reset()
        assert not node.world.joints("machine")


def test_wheels_stop_when_their_publisher_dies(domain: int, capfd: pytest.CaptureFixture[str]) -> None:
    """By default half a second of simulated time after the last velocity; a position stays.

    Tracks: test_joint_dynamics.py.
    """
    with fed({}) as node:
        node.give("heightmap", heightmap_message(np.zeros((101, 101)), stamp=node.now()))
        node.world.spawn_robot("rover", ROVER.read_text(), BodyState((4.0, 4.0, 0.0)), on_ground=True)
        position, velocity = [math.nan, math.nan, math.nan, 0.3], [4.0, 4.0, 4.0, math.nan]

        def speeds() -> list[float]:
            return [found.velocity for found in node.world.joints("rover")]

        for _ in range(2):
            node.give("joint_commands", JointState(name=WHEELS, position=position, velocity=velocity), steps=110)
            assert speeds()[:3] == pytest.approx([4.0] * 3, rel=0.05)
        node.run(120)
        assert speeds() == pytest.approx([0.0] * 4, abs=0.02)
        assert node.world.joints("rover")[3].position == pytest.approx(0.3, abs=0.01)
        assert capfd.readouterr().err.count("no command came for front_left, front_right, rear_left of 'rover'") == 1


def test_a_latched_description_is_a_robot_that_later_ones_replace(probe: Probe) -> None:
    text = ROVER.read_text()
    publisher = probe.node.create_publisher(String, "/terrain_collider/robot_description", LATCHED)
    publisher.publish(String(data=text))  # before there is a node
    with probe.running(parameters={**STANDING, "robot.description": ""}):
        settle(probe)
        mine, heavy = probe.latest("odometry").pose.pose.position, text.replace('"10.0"', '"20.0"')
        publisher.publish(String(data=str(ROVER)))  # what else is refused: test_robot_descriptions.py
        probe.wait_for(lambda: refusals(probe))
        assert probe.latest("joint_states").name == WHEELS
        assert probe.latest("odometry").pose.pose.position == mine
        publisher.publish(String(data=heavy))

        def heavier() -> bool:
            step(probe, 120)
            total = sum(found.wrench.force.z for found in probe.latest("contact_wrenches").wrenches)
            return bool(total == pytest.approx(24.0 * 9.81, rel=0.02))

        probe.wait_for(heavier)
        there = probe.latest("odometry").pose.pose.position
        assert (there.x, there.y) == pytest.approx((mine.x, mine.y), abs=0.02), "where the first one was"
