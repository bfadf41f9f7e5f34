"""Tracked bodies as stacks publish them, over real topics."""

import math
from collections.abc import Callable
from itertools import count
from time import monotonic

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from smartmesh_msgs.srv import QueryGround
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from smartmesh_ros.tools.testing import Probe, Process, pose_message
from tests.node.shared import LATCHED, changed, patch_vertices, stamped, transform_message

SHARED = {
    "bodies.poses": ["arm=/arm/tip_pose", "/second/pose"],
    "bodies.odometry": ["rover=~/tracked_odometry", "pusher=/odom"],
    "frame_id": "map",
}
YAW = 0.5 * math.pi


def transform(probe: Probe, parent: str, child: str, x: float, y: float, yaw: float = 0.0) -> TFMessage:
    return TFMessage(transforms=[transform_message(probe, parent, child, (x, y, 0.0), yaw)])


def flat_map(probe: Probe) -> None:
    probe.publish_map(np.zeros((200, 200)), resolution=0.1, origin=(-10.0, -10.0, 0.0))


def patch_near(probe: Probe, name: str, x: float, y: float, act: Callable[[], None]) -> None:
    """Waits until the patch of the body is around (x, y), doing ``act`` again and again."""

    def there() -> bool:
        act()
        found = patch_vertices(probe).get(name)
        return found is not None and bool(np.abs(found[:, :2].mean(axis=0) - (x, y)).max() <= 0.06)

    probe.wait_for(there)


def bodies(probe: Probe) -> set[str]:
    return set(patch_vertices(probe))


def test_topics_of_poses_and_odometry_each_bring_a_body_that_times_out(shared: Probe) -> None:
    with changed(shared, {"bodies.timeout": 0.5}):
        flat_map(shared)
        arm, second = shared.publisher(PoseStamped, "/arm/tip_pose"), shared.publisher(PoseStamped, "/second/pose")
        rover = shared.publisher(Odometry, "tracked_odometry")

        def publish() -> None:
            arm.publish(stamped(shared, PoseStamped(pose=pose_message((1.0, 2.0, 0.2))), "map"))
            second.publish(stamped(shared, PoseStamped(pose=pose_message((4.0, 5.0, 0.2))), "map"))
            odometry = Odometry(child_frame_id="base_link")
            odometry.pose.pose = pose_message((-3.0, 4.0, 0.2))
            rover.publish(stamped(shared, odometry, "map"))

        patch_near(shared, "arm", 1.0, 2.0, publish)
        patch_near(shared, "second.pose", 4.0, 5.0, publish)
        patch_near(shared, "rover", -3.0, 4.0, publish)

        def all_and_no_other() -> bool:  # told again: on a slow machine the first may have timed out meanwhile
            publish()
            return bodies(shared) == {"arm", "second.pose", "rover"}

        shared.wait_for(all_and_no_other)
        for topic in ("~/tracked_odometry", "/arm/tip_pose"):
            assert 0.0 <= float(shared.diagnostics("connections")[f"age of stamps on arrival, {topic} [s]"]) < 2.0
        shared.wait_for(lambda: not bodies(shared))
        lost = Odometry()
        lost.pose.pose = pose_message((math.nan, 0.0, 0.0))
        rover.publish(stamped(shared, lost, "map"))
        second.publish(stamped(shared, PoseStamped(pose=pose_message((4.0, 5.0, math.inf))), "map"))
        for key in ("refused, ~/tracked_odometry: non_finite", "refused, /second/pose: non_finite"):
            shared.wait_for(lambda key=key: shared.diagnostics("inputs").get(key) == "1")


def test_jumps_of_a_pose_are_counted_and_logged(shared: Probe, shared_node: tuple[Probe, Process]) -> None:
    flat_map(shared)
    second, places = shared.publisher(PoseStamped, "/second/pose"), count()

    def told() -> bool:  # many between two diagnostics
        for _ in range(5):
            pose = pose_message((100.0 * (next(places) % 2), 5.0, 0.2))
            second.publish(stamped(shared, PoseStamped(pose=pose), "map"))
            shared.spin(0.02)
        return int(shared.diagnostics("bodies").get("jumps on /second/pose", 0)) > 0

    shared.wait_for(told)
    assert "the pose of 'second.pose' jumped by 100 m" in shared_node[1].output


def test_poses_in_another_frame_are_transformed(shared: Probe, shared_node: tuple[Probe, Process]) -> None:
    with changed(shared, {"bodies.timeout": 60.0}):
        flat_map(shared)
        arm = shared.publisher(PoseStamped, "/arm/tip_pose")
        pose = PoseStamped(pose=pose_message((1.0, 0.0, 0.2)))

        def refused() -> bool:
            arm.publish(stamped(shared, pose, "odom"))
            shared.spin()
            return "no transform from 'odom' to 'map'" in shared_node[1].output

        shared.wait_for(refused)
        assert bodies(shared) == set()
        moving = shared.publisher(TFMessage, "/tf")

        def publish() -> None:
            moving.publish(transform(shared, "map", "odom", 2.0, 3.0, YAW))
            arm.publish(stamped(shared, pose, "odom"))

        patch_near(shared, "arm", 2.0, 4.0, publish)
        # The same for the other topics, and the frames of a robot that is turned the other way round.
        static = shared.publisher(TFMessage, "/tf_static", LATCHED)
        static.publish(transform(shared, "odom", "camera", 0.0, -1.0, -YAW))

        def publish_all() -> None:
            moving.publish(transform(shared, "map", "odom", 2.0, 3.0, YAW))
            shared.publish_bodies({"stone": (1.0, 0.0, 0.2)}, frame_id="camera")
            shared.publish_poses([(0.0, 1.0, 0.2)], frame_id="camera")

        patch_near(shared, "stone", 4.0, 3.0, publish_all)
        patch_near(shared, "body_0", 3.0, 4.0, publish_all)
        shared.publish_bodies({"stone": (1.0, 0.0, 0.2)}, frame_id="elsewhere")
        shared.wait_for(lambda: shared.diagnostics("inputs").get("refused, tracked_bodies: frame") is not None)


def test_frames_of_tf_are_bodies(probe: Probe) -> None:
    parameters = {
        "bodies.frames": ["robot1/base_link", "foot=robot1/foot", "post"],
        "bodies.timeout": 0.5,
        "frame_id": "map",
    }
    with probe.running(parameters=parameters) as process:
        flat_map(probe)
        moving, static = probe.publisher(TFMessage, "/tf"), probe.publisher(TFMessage, "/tf_static", LATCHED)
        foot = transform_message(probe, "robot1/base_link", "robot1/foot", (1.0, 0.0, 0.0))
        static.publish(TFMessage(transforms=[foot, transform_message(probe, "map", "post", (-5.0, -5.0, 0.0))]))

        def publish() -> None:
            moving.publish(transform(probe, "map", "odom", 1.0, 1.0))
            moving.publish(transform(probe, "odom", "robot1/base_link", 0.5, 0.0, YAW))

        patch_near(probe, "robot1.base_link", 1.5, 1.0, publish)
        patch_near(probe, "foot", 1.5, 2.0, publish)
        # What stands still by definition stays; what moved and is heard of no more is gone.
        probe.wait_for(lambda: bodies(probe) == {"post"})
        patch_near(probe, "post", -5.0, -5.0, lambda: None)
        # One that is impossible is refused by itself.
        bad = transform_message(probe, "odom", "robot1/base_link", (math.nan, 0.0, 0.0))
        moving.publish(TFMessage(transforms=[bad, transform_message(probe, "map", "odom", (1.0, 1.0, 0.0))]))
        probe.wait_for(lambda: probe.diagnostics("inputs").get("refused, /tf: non_finite") == "1")

        def publish_good() -> None:  # stamped anew each time: the diagnostics may have taken longer than the time-out
            moving.publish(transform(probe, "map", "odom", 1.0, 1.0))
            moving.publish(transform(probe, "odom", "robot1/base_link", 3.0, 0.0))

        patch_near(probe, "robot1.base_link", 4.0, 1.0, publish_good)
        assert "Traceback" not in process.output


@pytest.mark.parametrize("looped", [True, False])
def test_frames_whose_stamps_start_over_or_are_missing_stay_bodies(probe: Probe, looped: bool) -> None:
    """A recording of three seconds in a loop without a clock, and transforms typed by hand."""
    with probe.running(parameters={"bodies.frames": ["rover=base_link"], "frame_id": "map"}) as process:
        flat_map(probe)
        moving, start, key = probe.publisher(TFMessage, "/tf"), monotonic(), "refused, /tf: stamp_backwards"
        tracked: list[str] = []
        sent, stalled = [start], [start]

        def told_twice() -> bool:
            sent.append(monotonic())
            if sent[-1] - sent[-2] > 0.5:  # this test stalled, on a busy machine: the body may time out, and come back
                stalled.append(sent[-1])
                tracked.clear()
            message = transform(probe, "map", "base_link", 0.5 * ((monotonic() - start) % 3.0), 0.0)
            at = 1_000_000.0 + (monotonic() - start) % 3.0
            message.transforms[0].header.stamp = Time(sec=int(at), nanosec=int(at % 1 * 1e9)) if looped else Time()
            moving.publish(message)
            probe.spin(0.05)
            found = probe.newest_diagnostics()
            if sent[-1] - stalled[-1] < 3.0:  # diagnostics come once a second
                return False
            tracked.append(found["bodies"]["tracked"])
            if looped:
                return int(found["inputs"].get(key, 0)) >= 2 and len(tracked) > 60
            return int(found["connections"].get("without stamp on /tf", 0)) >= 20 and tracked[-1] == "1"

        probe.wait_for(told_twice)
        assert set(tracked[tracked.index("1") :]) == {"1"}
        words = "s older, as if the clock of its source was set back" if looped else "on /tf have no stamp"
        assert words in process.output
        if looped:
            return
        probe.wait_for(lambda: probe.diagnostics("bodies")["tracked"] == "0")


def test_without_tf_foreign_frames_are_refused_and_what_is_missing_is_named(
    probe: Probe, bare_environment: dict[str, str]
) -> None:
    with Process("terrain_collider", {"frame_id": "map"}, environment=bare_environment) as process:
        probe.wait_for(probe.connected, watch=process)
        flat_map(probe)

        def named() -> bool:
            probe.publish_poses([(0.0, 0.0, 0.2)], frame_id="odom")
            probe.spin()
            return "apt install ros-jazzy-tf2-msgs" in process.output

        probe.wait_for(named)
        probe.wait_for(lambda: int(probe.diagnostics("inputs").get("refused, body_poses: frame", 0)) > 0)
        asked = probe.call("query_ground", QueryGround, header=Header(frame_id="rover"))
        assert asked.message.startswith("no body is called 'rover'"), "who gave the name of a body needs no tf2_msgs"
        assert "apt install ros-jazzy-tf2-msgs" in asked.message
