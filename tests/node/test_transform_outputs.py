"""Frames on ``/tf``: of simulated bodies and robots, and never of others."""

from collections import Counter
from functools import partial
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, PointCloud2
from smartmesh_msgs.srv import CastRays, RemoveBody, StepPhysics
from std_msgs.msg import Header
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from smartmesh_ros.node.inputs.frames import FrameBuffer, Transform
from smartmesh_ros.tools.testing import Probe
from tests.node.shared import LATCHED, changed, show_level_ground, transform_message
from tests.node.shared import spawn as spawn_body
from tests.node.test_robot_outputs import ARM, STIFF, spawn

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


def test_bodies_and_links_have_frames_where_they_are(shared: Probe) -> None:
    show_level_ground(shared)
    shared.publish_bodies({"tracked": (1.0, 1.0, 0.3)})
    spawn_body(shared, "ball", (2, 1, 0.5))
    spawn(shared, "one", ARM, 0.7)
    wanted = {"ball": "map", "base": "map", "arm": "base", "slider": "arm", "one": "base"}
    shared.wait_for(lambda: parents(shared) == wanted)
    spawn(shared, "two", ARM, 1.7)
    spawn(shared, "stiff", STIFF["fixed_links"], 2.5)
    more = {"two/base": "map", "two/arm": "two/base", "two/slider": "two/arm", "two": "two/base"}
    more |= {"stiff/base": "map", "stiff/lidar": "stiff/base", "stiff": "stiff/base"}
    shared.wait_for(lambda: parents(shared) == wanted | more)
    publisher = shared.publisher(JointState, "joint_commands")

    def turned() -> bool:
        publisher.publish(JointState(name=["hinge", "slide"], position=[0.5, 0.2]))
        return np.allclose(shared.latest("joint_states").position[:2], (0.5, 0.2), atol=0.01)

    shared.wait_for(turned)
    assert shared.call("pause", SetBool, data=True).success
    received, bases = shared.received[TF], shared.listen("odometry", Odometry)
    assert shared.call("step", StepPhysics, steps=1).success
    for messages in (received, bases):
        messages.clear()
    shared.wait_for(lambda: len(received) > 3 and len(bases) > 9)  # the last of them are of after the step
    buffer = buffer_of(received[-1])
    joints = dict(zip((m := shared.latest("joint_states")).name, m.position, strict=True))
    arm, _ = buffer.lookup("base", "slider")
    c, s = np.cos(joints["hinge"]), np.sin(joints["hinge"])
    assert arm.translation == pytest.approx((0.1 + c * joints["slide"], 0.2 + s * joints["slide"], 0.3), abs=1e-6)
    assert {message.child_frame_id for message in bases[-3:]} == {"base", "two/base", "stiff/base"}
    for message in bases[-3:]:
        p, _ = buffer.lookup("map", message.child_frame_id)
        q = message.pose.pose.position
        assert p.translation == pytest.approx((q.x, q.y, q.z), abs=1e-9), "the same as the odometry says"
    assert shared.call("remove_body", RemoveBody, id="one").success
    assert shared.call("pause", SetBool, data=False).success
    shared.wait_for(lambda: parents(shared) == {"ball": "map"} | more)


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


def test_no_frame_has_two_parents_in_one_message(shared: Probe) -> None:
    """A body that is called as a link of the robot without prefix."""
    show_level_ground(shared)
    spawn(shared, "slider", ARM.replace('"arm"', '"leaf"').replace('"base"', '"stem"'), 0.7)
    spawn_body(shared, "leaf", (2, 1, 0.5))
    shared.wait_for(lambda: parents(shared) == {"stem": "map", "leaf": "stem", "slider": "leaf"})
    counts = Counter(item.child_frame_id for item in shared.received[TF][-1].transforms)
    assert set(counts.values()) == {1}


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
        for _ in range(3):
            shared.latest("body_states")
        received.clear()
        for _ in range(20):
            shared.latest("body_states")
        assert len({(m.transforms[0].header.stamp.sec, m.transforms[0].header.stamp.nanosec) for m in received}) == len(
            received
        ), "tf2 warns of a frame that comes twice at one time"


def test_the_frame_of_a_sensors_cloud_exists(shared: Probe) -> None:
    show_level_ground(shared)
    spawn(shared, "rover", STIFF["fixed_links"])
    clouds = shared.listen("/shared/terrain_sensor/points", PointCloud2)
    static = shared.listen("/tf_static", TFMessage, LATCHED)
    camera: dict[str, Any] = {"sensor": "depth_camera", "camera.columns": 8, "camera.rows": 6, "pitch": 0.6}
    with shared.running("terrain_sensor", {"frame": "rover", "through": ["rover"], **camera}):
        optical = "shared/terrain_sensor_optical"  # with the namespace, because others have a camera of this name
        shared.wait_for(lambda: clouds and optical in {item.child_frame_id for m in static for item in m.transforms})
        shared.wait_for(lambda: "rover" in parents(shared))
        buffer = buffer_of(shared.received[TF][-1], *static)
        for frame in (clouds[-1].header.frame_id, optical):
            buffer.lookup("map", frame)

    # A frame that the node publishes is one to ask in.
    header = Header(frame_id="base")
    asked: dict[str, Any] = {"header": header, "origins": [0.0, 0.0, 2.0], "directions": [0.0, 0.0, -1.0], "range": 5.0}
    shared.wait_for(lambda: shared.call("cast_rays", CastRays, **asked).success)


def test_a_body_cannot_follow_a_frame_of_its_own_node(probe: Probe) -> None:
    """It would be inside the simulated robot and throw it."""
    with probe.running(parameters={"frame_id": "map", "publish.tf": 50.0, "bodies.frames": ["ghost=base"]}):
        show_level_ground(probe)
        spawn(probe, "rover", STIFF["one_link"])
        probe.wait_for(lambda: "refused, bodies.frames: own_topic" in probe.diagnostics("inputs"))
        assert probe.diagnostics("bodies")["tracked"] == "0"
