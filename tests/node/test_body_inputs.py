"""Tracked bodies as stacks publish them; their shapes; their velocities, estimated from poses; time-outs by arrival."""

import math
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, PoseStamped, Twist, Vector3
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray
from tf2_msgs.msg import TFMessage

from smartmesh_ros import Box, Cylinder, Sphere, World
from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.node import session
from smartmesh_ros.node.inputs.tracking import Tracking
from smartmesh_ros.node.refusals import LOG_PERIOD
from smartmesh_ros.tools.testing import pose_message
from tests.bodies import about_z
from tests.examples import examples
from tests.node.shared import Fed, Logged, fed, stamped, transform_message
from tests.urdfs import ROVER
from tests.world.test_tracked_shapes import ARM as TRACKED_ARM

# However slow the machine is, no body times out by itself.
pytestmark = pytest.mark.usefixtures("now")
INPUTS = {
    "bodies.poses": ["arm=/arm/tip_pose", "/second/pose"],
    "bodies.odometry": ["rover=~/tracked_odometry", "pusher=/odom"],
    "frame_id": "map",
}
YAW = 0.5 * math.pi


def transform(node: Fed, parent: str, child: str, x: float, y: float, yaw: float = 0.0) -> TFMessage:
    return TFMessage(transforms=[transform_message(node, parent, child, (x, y, 0.0), yaw)])


def test_topics_of_poses_and_odometry_each_bring_a_body_that_times_out(logged: Logged, now: list[float]) -> None:
    with fed({**INPUTS, "bodies.timeout": 0.5}) as node:
        odometry = Odometry(child_frame_id="base_link")
        odometry.pose.pose = pose_message((-3.0, 4.0, 0.2), YAW)
        odometry.twist.twist = Twist(linear=Vector3(x=2.0), angular=Vector3(y=0.5))
        node.give("~/tracked_odometry", stamped(node, odometry), steps=0)
        state = node.world.state("rover")
        assert (state.linear, state.angular) == (pytest.approx((0.0, 2.0, 0.0)), pytest.approx((-0.5, 0.0, 0.0)))
        for topic, x, y in (("/arm/tip_pose", 1.0, 2.0), ("/second/pose", 4.0, 5.0)):
            node.give(topic, stamped(node, PoseStamped(pose=pose_message((x, y, 0.2)))))
        found = {name: place(node, name) for name in node.world.bodies}
        assert found == {"rover": pytest.approx((-3.0, 4.0), abs=0.3), "arm": (1.0, 2.0), "second.pose": (4.0, 5.0)}
        ages = node.node._outputs._diagnostics._ends()[2]
        for topic in ("~/tracked_odometry", "/arm/tip_pose"):
            assert 0.0 <= float(ages[f"age of stamps on arrival, {topic} [s]"]) < 2.0
        node.play(now, 1.0, math.inf, lambda: None)
        assert not node.world.bodies
        for x in (0.0, 100.0):
            now[0] += 0.1
            node.give("/second/pose", stamped(node, PoseStamped(pose=pose_message((x, 5.0, 0.2)))))
        assert node.node._outputs._diagnostics._inputs()[2]["jumps on /second/pose"] == 1
        assert "the pose of 'second.pose' jumped by 100 m" in logged()


def place(node: Fed, name: str) -> tuple[float, float]:
    return node.world.state(name).position[:2]


def test_poses_in_another_frame_are_transformed(logged: Logged) -> None:
    with fed(INPUTS) as node:
        tip = PoseStamped(pose=pose_message((1.0, 0.0, 0.2)))
        node.give("/arm/tip_pose", stamped(node, tip, "odom"))
        assert "no transform from 'odom' to 'map'" in logged()
        assert not node.world.bodies
        node.give("/tf", transform(node, "map", "odom", 2.0, 3.0, YAW))
        node.give("/arm/tip_pose", stamped(node, tip, "odom"))
        assert place(node, "arm") == pytest.approx((2.0, 4.0))
        # The same for the other topics, and the frames of a robot that is turned the other way round.
        node.give("/tf_static", transform(node, "odom", "camera", 0.0, -1.0, -YAW))
        stones = TrackedBodyArray(bodies=[TrackedBody(id="stone", pose=tip.pose)])
        node.give("tracked_bodies", stamped(node, stones, "camera"))
        assert place(node, "stone") == pytest.approx((4.0, 3.0))
        node.give("body_poses", stamped(node, PoseArray(poses=[pose_message((0.0, 1.0, 0.2))]), "camera"))
        assert place(node, "body_0") == pytest.approx((3.0, 4.0))
        node.require_refused("tracked_bodies", [("frame", stamped(node, stones, "elsewhere"))])
        for count in (4, 2):  # a shorter array takes bodies away
            poses = [pose_message((0.3 * index, 1.0, 0.2)) for index in range(count)]
            node.give("body_poses", stamped(node, PoseArray(poses=poses)))
            assert node.world.bodies.keys() == {"arm", "stone", *(f"body_{index}" for index in range(count))}


def test_each_body_that_times_out_is_named(now: list[float], logged: Logged) -> None:
    """Also those that follow another within the pause of that line in the log."""
    with fed({"bodies.timeout": 0.5}) as node:
        for name in ("first", "second"):
            node.give("tracked_bodies", TrackedBodyArray(bodies=[TrackedBody(id=name)]), steps=1)
            node.play(now, 1.0, math.inf, lambda: None)
        now[0] += LOG_PERIOD
        node.run(1)
        assert not node.world.bodies
    lines = [line for line in logged().splitlines() if "bodies.timeout" in line]
    assert [line.partition(": removed ")[2] for line in lines] == ["'first'", "'second'"]


def test_frames_of_tf_are_bodies(now: list[float]) -> None:
    frames = ["robot1/base_link", "foot=robot1/foot", "post"]
    with fed({"bodies.frames": frames, "bodies.timeout": 0.5, "frame_id": "map"}) as node:
        foot = transform_message(node, "robot1/base_link", "robot1/foot", (1.0, 0.0, 0.0))
        post = transform_message(node, "map", "post", (-5.0, -5.0, 0.0))
        node.give("/tf_static", TFMessage(transforms=[foot, post]))

        def drive(x: float, yaw: float = 0.0) -> None:
            node.give("/tf", transform(node, "map", "odom", 1.0, 1.0))
            node.give("/tf", transform(node, "odom", "robot1/base_link", x, 0.0, yaw))

        drive(0.5, YAW)
        assert place(node, "robot1.base_link") == pytest.approx((1.5, 1.0))
        assert place(node, "foot") == pytest.approx((1.5, 2.0))
        # What stands still by definition stays; what moved and is heard of no more is gone.
        node.play(now, 1.0, math.inf, lambda: None)
        assert node.world.bodies.keys() == {"post"}
        assert place(node, "post") == (-5.0, -5.0)
        # One that is impossible is refused by itself.
        bad = transform_message(node, "odom", "robot1/base_link", (math.nan, 0.0, 0.0))
        good = transform_message(node, "map", "odom", (1.0, 1.0, 0.0))
        node.require_refused("/tf", [("non_finite", TFMessage(transforms=[bad, good]))])
        drive(3.0)
        assert place(node, "robot1.base_link") == pytest.approx((4.0, 1.0))


@pytest.mark.parametrize("looped", [True, False])
def test_frames_whose_stamps_start_over_or_are_missing_stay_bodies(
    logged: Logged, looped: bool, now: list[float]
) -> None:
    """A recording of three seconds in a loop without a clock, and transforms typed by hand."""
    frames = {"bodies.frames": ["rover=base_link"], "decks": ["{deck: raft, frame: base_link}"]}
    with fed({**frames, "frame_id": "map", "bodies.timeout": 60.0, "physics.rate": 60.0}) as node:
        for number in range(75):
            message, tenths = transform(node, "map", "base_link", 0.05 * (number % 30), 0.0), number % 30
            at = Time(sec=1_000_000 + tenths // 10, nanosec=tenths % 10 * 100_000_000)
            message.transforms[0].header.stamp = at if looped else Time()
            node.give("/tf", message, steps=0)
            node.play(now, 0.1, math.inf, lambda: None)
            assert node.world.bodies.keys() == {"rover"}
        words = "s older, as if the clock of its source was set back" if looped else "on /tf have no stamp"
        assert words in logged()
        refused = node.node.refusals.counts
        assert refused.total() == refused["/tf: stamp_backwards"] == 2 * looped
        assert node.world.terrain.deck("raft").frame(node.world.time).position[0] == pytest.approx(0.7, abs=0.2)
        said = node.node._outputs._diagnostics._inputs()[2]
        assert said.get("without stamp on /tf", 0) == 75 * (not looped)
        assert not node.set("bodies.timeout", 0.2)
        node.play(now, 0.3, math.inf, lambda: None)
        assert not node.world.bodies


RADIUS = 0.4


def pose(x: float, y: float = 0.0, yaw: float = 0.0) -> BodyState:
    return BodyState((x, y, RADIUS), about_z(yaw))


@pytest.mark.parametrize("rate", [5.0, 10.0, 100.0])
@pytest.mark.parametrize("jump", [0.05, 0.3])
def test_a_jump_of_a_pose_gives_no_velocity(world: World, rate: float, jump: float) -> None:
    """As by a loop closure, there and back: of up to 30 m/s, with which it would push what it does not touch."""
    tracking = Tracking(world, 60.0)
    states = [*[pose(0.0)] * 3, *[pose(jump)] * 3, *[pose(0.0)] * 3, *[pose(jump, yaw=3.0)] * 3]
    for number, state in enumerate(states):
        tracking.update("rover", RADIUS, state, number / rate)
        found = world.state("rover")
        assert (*found.linear, *found.angular) == pytest.approx([0.0] * 6, abs=1e-9)


@examples(30)
@given(st.floats(0.1, 5.0), st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi), st.floats(5.0, 60.0))
def test_steady_motion_keeps_its_velocity(speed: float, spin: float, course: float, rate: float) -> None:
    with World() as world:
        tracking, x, y = Tracking(world, 60.0), 0.0, 0.0  # on a circle
        for number in range(6):
            yaw = course + spin * number / rate
            for _ in range(2):  # a stamp that comes again says nothing new
                tracking.update("rover", 0.2, pose(x, y, yaw), number / rate)
            x, y = x + speed * math.cos(yaw) / rate, y + speed * math.sin(yaw) / rate
        state = world.state("rover")
        assert math.hypot(*state.linear) == pytest.approx(speed, rel=0.03)
        assert state.angular[2] == pytest.approx(spin, abs=1e-6)


def test_changes_that_are_too_fast_give_no_velocity_and_are_said(world: World) -> None:
    tracking = Tracking(world, 60.0, max_velocity=2.0)
    tracking.update("rover", RADIUS, pose(0.0), 0.0)
    for number in range(1, 5):
        said = tracking.update("rover", RADIUS, pose(0.3 * number), 0.1 * number)
        assert "'rover' jumped by 0.3 m" in said and "bodies.max_velocity = 2" in said
        assert world.state("rover").linear == (0.0, 0.0, 0.0)
    tracking.max_velocity = 5.0
    assert tracking.update("rover", RADIUS, pose(1.5), 0.5) == ""
    # A body that spins in place moves at its surface.
    assert "jumped by 0 m" in tracking.update("rover", RADIUS, pose(1.5, yaw=3.0), 0.6)


def test_a_source_that_states_velocities_is_believed_when_it_states_none(world: World) -> None:
    tracking = Tracking(world, 60.0)
    for number in range(4):
        tracking.update("stands", 0.2, pose(0.5 * number), 0.5 * number, stated=True)
        assert world.state("stands").linear == (0.0, 0.0, 0.0)
    tracking.update("stops", 0.2, BodyState((3.0, 3.0, 0.2), linear=(1.0, 0.0, 0.0)), 0.0)
    tracking.update("stops", 0.2, BodyState((3.1, 3.0, 0.2)), 0.1)
    assert world.state("stops").linear == (0.0, 0.0, 0.0)


@examples(30)
@given(late=st.floats(0.0, 1e9), rate=st.floats(2.5, 60.0))
def test_a_body_that_is_heard_of_neither_stops_nor_goes_however_old_its_poses_are(late: float, rate: float) -> None:
    with World() as world:
        tracking = Tracking(world, timeout=0.5)
        for number in range(20):
            heard = 1e9 + number / rate
            state = BodyState((number / rate, 0.0, 0.2), linear=(1.0, 0.0, 0.0))
            tracking.update("rover", 0.2, state, heard - late, heard)
            assert tracking.expire(heard + 0.99 / rate) == []
            assert world.state("rover").linear == (1.0, 0.0, 0.0)
        assert tracking.expire(heard + 0.51) == ["rover"]


def test_a_stall_of_the_node_takes_no_tracked_body_away_whose_poses_wait_to_be_read(now: list[float]) -> None:
    with fed({"frame_id": "map"}) as node:
        at = [TrackedBody(id="crane", twist=Twist(linear=Vector3(x=1.0)))]
        node.play(now, 0.3, 0.05, lambda: node.give("tracked_bodies", TrackedBodyArray(bodies=at), 0))
        uid = node.world.bodies["crane"].uid
        now[0] += 5.0
        node.play(now, 0.05, math.inf, lambda: None)
        assert node.world.bodies["crane"].uid == uid and node.world.state("crane").linear[0] == pytest.approx(1.0)
        node.play(now, 1.2, math.inf, lambda: None)  # the time-out counts again
        assert not node.world.bodies


def test_shapes_come_from_the_message_or_else_from_the_parameter() -> None:
    entries = ["{body: crate, shape: box, size: [1, 0.5, 0.5]}", "{body: drum, shape: cylinder, size: [0.4, 0.2]}"]
    with fed({"bodies.shapes": entries, "bodies.poses": ["drum=/drum"], "frame_id": "map"}) as node:
        bodies = [TrackedBody(id="crate"), TrackedBody(id="ball", radius=0.25)]
        node.give("tracked_bodies", stamped(node, TrackedBodyArray(bodies=bodies)))
        node.give("/drum", stamped(node, PoseStamped()))
        shapes = {name: body.shape for name, body in node.world.bodies.items()}
        assert shapes == {"crate": Box(1, 0.5, 0.5), "drum": Cylinder(height=0.4, radius=0.2), "ball": Sphere(0.25)}
        bodies = [TrackedBody(id="crate", shape=TrackedBody.SHAPE_BOX, dimensions=np.array([2, 2, 2], np.float32))]
        node.give("tracked_bodies", stamped(node, TrackedBodyArray(bodies=bodies)))
        assert node.world.bodies["crate"].shape == Box(2.0, 2.0, 2.0)
        flat = TrackedBody(id="a", shape=1, dimensions=np.array([1, 0, 1], np.float32))
        for reason, body in (("shape", TrackedBody(id="a", shape=7)), ("geometry", flat)):
            node.require_refused("tracked_bodies", [(reason, stamped(node, TrackedBodyArray(bodies=[body])))])


def test_a_tracked_robot_follows_its_root_and_its_joints(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(TRACKED_ARM)
    parameters = {"bodies.shapes": [f"{{body: rig, urdf: {file}}}"], "bodies.odometry": ["rig=/rig"], "frame_id": "map"}
    with fed(parameters) as node:
        joints = JointState(name=["rig/yaw", "reach", "elsewhere"], position=[0.5, 0.2, 1.0], velocity=[2.0, 0.0, 9.0])
        node.give("tracked_joint_states", joints)
        message = stamped(node, Odometry())
        message.pose.pose = pose_message((1.0, 0.0, 0.5))
        message.twist.twist = Twist(linear=Vector3(x=0.3))
        node.give("/rig", message, 0)
        assert node.world.bodies.keys() == {"rig.base", "rig.arm", "rig.left.hand"}
        hand = node.world.state("rig.left.hand")
        out = np.array([math.cos(0.5), math.sin(0.5), 0.0])
        np.testing.assert_allclose(hand.position, (1.0, 0.0, 0.9) + 1.25 * out, atol=1e-4)
        np.testing.assert_allclose(hand.linear, (0.3, 0.0, 0.0) + 2.5 * np.array([-out[1], out[0], 0.0]), atol=1e-4)
        node.require_refused("tracked_joint_states", [("length", JointState(name=["yaw"]))])
        node.give("tracked_joint_states", JointState(name=["yaw"], position=[0.5], velocity=[1e6]))
        message.pose.pose.position.x = 2.0
        node.require_refused("/rig", [("velocity", stamped(node, message))])
        assert node.world.state("rig.base").position[0] < 1.5, "no part moves without the others"


def test_joints_of_several_tracked_robots_are_taken_together() -> None:
    shapes = [f"{{body: {name}, urdf: {ROVER}}}" for name in ("rig", "twin")]
    with fed({"bodies.shapes": shapes, "bodies.odometry": ["rig=/rig"], "frame_id": "map"}) as node:
        bad = JointState(name=["rig/front_left", "twin/front_left"], position=[0.5, math.nan])
        node.require_refused("tracked_joint_states", [("non_finite", bad)])
        node.give("/rig", stamped(node, Odometry()), 0)
        turn = node.world.state("rig.front_left_wheel").orientation
        assert turn == pytest.approx((0.0, 0.0, 0.0, 1.0)), "one robot moved its joints without the other"


def test_bodies_and_robots_of_a_message_find_room_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """None of them is there if there is no room for all; parts that are there need no more of it."""
    monkeypatch.setattr(session, "MOST_BODIES", 5)
    with fed({"bodies.shapes": [f"{{body: rig, urdf: {ROVER}}}"], "frame_id": "map"}) as node:
        both = TrackedBodyArray(bodies=[TrackedBody(id="stone"), TrackedBody(id="rig")])
        node.require_refused("tracked_bodies", [("size", stamped(node, both))])
        assert not node.world.bodies
        for _ in range(2):
            node.give("tracked_bodies", stamped(node, TrackedBodyArray(bodies=both.bodies[1:])))
        assert len(node.world.bodies) == 5 and node.node.refusals.counts.total() == 1
