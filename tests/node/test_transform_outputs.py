"""Frames on ``/tf``: of simulated bodies and robots, and never of others."""

from collections import Counter
from functools import partial

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.node.inputs.frames import FrameBuffer
from smartmesh_ros.tools.testing import Probe
from tests.node.shared import LATCHED, changed, on_level, show_level_ground, transform_message
from tests.node.shared import spawn as spawn_body
from tests.node.test_robot_outputs import ARM, STIFF, spawn
from tests.urdfs import robot

SHARED = {"frame_id": "map", "publish.tf": 50.0}
TF, NAME = "/tf", "terrain_collider"


def parents(probe: Probe, messages: int = 3) -> dict[str, str]:
    """Parents by frame, in the next messages on /tf."""
    received = probe.listen(TF, TFMessage)
    seen = len(received)
    probe.wait_for(lambda: len(received) >= seen + messages)
    return {item.child_frame_id: item.header.frame_id for message in received[seen:] for item in message.transforms}


def buffer_of(*messages: TFMessage) -> FrameBuffer:
    """All frames of some messages."""
    buffer = FrameBuffer()
    for item in (item for message in messages for item in message.transforms):
        t, q = item.transform.translation, item.transform.rotation
        pose = Transform((t.x, t.y, t.z), (q.x, q.y, q.z, q.w))
        buffer.add(item.header.frame_id, item.child_frame_id, pose, None)
    return buffer


def test_a_link_that_is_named_like_a_body_has_the_prefix_of_its_robot() -> None:
    with on_level(SHARED, keep=["/tf"]) as run:
        run.world.spawn("base", Sphere(0.2), 1.0, BodyState((2.0, 1.0, 0.5)))
        run.world.spawn_robot("robot", robot(ARM), BodyState((0.7, 2.0, 0.1)))
        run.run(2.0)
        frames = run.received("/tf")[-1].transforms
        assert {frame.child_frame_id: frame.header.frame_id for frame in frames} == {
            "base": "map", "robot/base": "map", "robot/arm": "robot/base", "robot/slider": "robot/arm",
            "robot": "robot/base",
        }  # fmt: skip


def test_bodies_and_links_have_frames_where_they_are() -> None:
    with on_level(SHARED, keep=["/tf", "joint_states", "odometry"]) as run:

        def parents() -> dict[str, str]:
            run.run(run.time + 1.5)
            return {item.child_frame_id: item.header.frame_id for item in run.received("/tf")[-1].transforms}

        def add(name: str, links: str, x: float) -> None:
            run.world.spawn_robot(name, robot(links), BodyState((x, 2.0, 0.1)))

        run.world.track("tracked", 0.3, BodyState((1.0, 1.0, 0.3)))
        run.world.spawn("ball", Sphere(0.2), 1.0, BodyState((2.0, 1.0, 0.5)))
        add("one", ARM, 0.7)
        wanted = {"ball": "map", "base": "map", "arm": "base", "slider": "arm", "one": "base"}
        assert parents() == wanted
        add("two", ARM, 1.7)
        add("stiff", STIFF["fixed_links"], 2.5)
        more = {"two/base": "map", "two/arm": "two/base", "two/slider": "two/arm", "two": "two/base"}
        more |= {"stiff/base": "map", "stiff/lidar": "stiff/base", "stiff": "stiff/base"}
        run.give("joint_commands", JointState(name=["hinge", "slide"], position=[0.5, 0.2]))
        assert parents() == wanted | more
        buffer, joints = buffer_of(run.received("/tf")[-1]), run.received("joint_states")[-1]
        turn, shift = joints.position[:2]
        assert (turn, shift) == pytest.approx((0.5, 0.2), abs=0.01)
        arm, _ = buffer.lookup("base", "slider")
        there = (0.1 + np.cos(turn) * shift, 0.2 + np.sin(turn) * shift, 0.3)
        assert arm.translation == pytest.approx(there, abs=1e-3)
        bases = {message.child_frame_id: message.pose.pose.position for message in run.received("odometry")[-3:]}
        assert bases.keys() == {"base", "two/base", "stiff/base"}
        for name, place in bases.items():
            found, _ = buffer.lookup("map", name)
            assert found.translation == pytest.approx((place.x, place.y, place.z), abs=1e-3), "as the odometry says"
        run.world.remove("one")
        assert parents() == {"ball": "map"} | more
        # No frame has two parents: of a body that is called as a link of the robot without prefix.
        add("slider", ARM.replace('"arm"', '"leaf"').replace('"base"', '"stem"'), 0.7)
        run.world.spawn("leaf", Sphere(0.2), 1.0, BodyState((2.0, 1.5, 0.5)))
        assert parents() == {"ball": "map", "stem": "map", "leaf": "stem", "slider": "leaf"} | more
        counts = Counter(item.child_frame_id for item in run.received("/tf")[-1].transforms)
        assert set(counts.values()) == {1}


def test_frames_of_others_are_left_to_them(shared: Probe) -> None:
    """Of a robot_state_publisher, of a localisation, and above the map."""
    show_level_ground(shared)
    links = ARM.replace('"base"', '"trunk"').replace('"arm"', '"limb"').replace('"slider"', '"hand"')
    spawn(shared, "one", links, 0.7)
    shared.wait_for(lambda: {"trunk", "limb", "hand", "one"} <= parents(shared).keys())
    publisher = shared.node.create_publisher(TFMessage, TF, 10)
    latched = shared.node.create_publisher(TFMessage, "/tf_static", LATCHED)

    item = partial(transform_message, shared)
    latched.publish(TFMessage(transforms=[item("trunk", "limb")]))
    shared.wait_for(lambda: parents(shared) == {"trunk": "map", "hand": "limb", "one": "trunk"})
    publisher.publish(TFMessage(transforms=[item("earth", "map"), item("odom", "/trunk")]))
    shared.wait_for(lambda: parents(shared) == {"hand": "limb", "one": "trunk"})
    # A body that is called as a frame above the terrain's would make a loop of the tree.
    for name in ("earth", "map"):
        spawn_body(shared, name)
    spawn_body(shared, "ball")
    shared.wait_for(lambda: parents(shared) == {"hand": "limb", "one": "trunk", "ball": "map"})
    shared.wait_for(lambda: parents(shared).get("trunk") == "map")  # nobody publishes it any more


def test_the_rate_may_change_and_a_clock_that_stands_still_sends_nothing(shared: Probe) -> None:
    show_level_ground(shared)
    spawn(shared, "stiff", STIFF["one_link"])
    shared.wait_for(lambda: "stiff" in parents(shared))
    with changed(shared, {"publish.tf": 0.0}):
        shared.wait_for(lambda: NAME not in {peer.node_name for peer in shared.node.get_publishers_info_by_topic(TF)})
    shared.wait_for(lambda: "stiff" in parents(shared))
    with changed(shared, {"publish.clock": 100.0}):
        assert shared.call("pause", SetBool, data=True).success
        received = shared.received[TF]
        for count in (3, 20):
            received.clear()
            for _ in range(count):
                shared.latest("body_states")
        stamps = [(stamp.sec, stamp.nanosec) for stamp in (message.transforms[0].header.stamp for message in received)]
        assert len(set(stamps)) == len(stamps), "tf2 warns of a frame that comes twice at one time"
