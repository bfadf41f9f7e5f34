"""Bases that drive by velocities, their odometry and frames, and IMUs, over real DDS and in this process."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Box, HeightMap
from smartmesh_ros.tools.testing import Probe, pose_message
from tests import urdfs
from tests.node.shared import fed, seconds, show_level_ground, spawn
from tests.node.test_transform_outputs import buffer_of
from tests.world.test_bases import HINGES, HUSKY_WHEELS, RACECAR, REAR, UNDERCARRIAGE

BASES = [
    f"{{body: husky, wheels: [{', '.join(HUSKY_WHEELS)}], publish_tf: true, odom_frame: husky/odom}}",
    f"{{body: car, wheels: [{', '.join(REAR)}], steering: [{', '.join(HINGES)}], publish_tf: true}}",
    "{body: digger, tracks: [left_track, right_track], linear_limit: 0.4}",
]
SHARED = {
    "frame_id": "map", "publish.tf": 30.0, "publish.body_states": 60.0, "bases": BASES,
    "imus": ["{body: husky, link: imu_link, rate: 60, gyroscope_noise_density: 0.002}", "{body: car}"],
}  # fmt: skip


ROOTS = {"husky": "base_footprint", "car": "base_link", "digger": "chassis"}
URDFS = {"husky": urdfs.HUSKY, "car": RACECAR, "digger": UNDERCARRIAGE}


def standing(probe: Probe, *robots: str) -> None:
    """Robots stand on level ground."""
    show_level_ground(probe, 101)
    for place, robot in enumerate(robots):
        spawn(probe, robot, urdf=URDFS[robot], pose=pose_message((2.0, 2.0 + 2.0 * place, 0.0)), on_ground=True)


@pytest.mark.parametrize(
    ("robot", "linear", "angular", "expected"),
    [("husky", 0.4, 0.0, 0.4), ("car", 0.5, 0.5, 0.5), ("digger", 0.9, 0.0, 0.4)],
)
@pytest.mark.parametrize("stamped", [False, True])
def test_a_robot_drives_by_velocities_and_stops_without(
    shared: Probe, robot: str, linear: float, angular: float, expected: float, stamped: bool
) -> None:
    standing(shared, robot)
    odometry = shared.listen(f"odom/{robot}", Odometry)
    twist = Twist(linear=Vector3(x=linear), angular=Vector3(z=angular))
    if stamped:
        publisher = shared.publisher(TwistStamped, f"cmd_vel_stamped/{robot}")
    else:
        publisher = shared.publisher(Twist, f"cmd_vel/{robot}")

    def speed() -> tuple[float, float]:
        state = next(body for body in shared.latest("body_states").bodies if body.id == robot)
        return math.hypot(state.twist.linear.x, state.twist.linear.y), state.twist.angular.z

    def drives() -> bool:
        message: Any = TwistStamped(twist=twist) if stamped else twist
        if stamped:
            message.header.stamp = shared.now()
        publisher.publish(message)
        return speed() == pytest.approx((expected, angular), abs=0.04)

    shared.wait_for(drives)
    last = odometry[-1]
    assert last.twist.twist.linear.x == pytest.approx(expected, abs=0.05)
    assert last.header.frame_id == ("husky/odom" if robot == "husky" else "odom")
    assert last.child_frame_id == ROOTS[robot]
    shared.wait_for(lambda: speed()[0] < 0.05)


def test_the_frame_of_odometry_is_between_the_map_and_the_root_link(shared: Probe) -> None:
    """As of REP 105: the chain map, odom, root link gives the true pose, whatever the odometry drifts."""
    standing(shared, "car")
    publisher = shared.publisher(Twist, "cmd_vel/car")
    received, truth = shared.listen("/tf", TFMessage), shared.listen("odometry", Odometry)

    def far() -> bool:
        publisher.publish(Twist(linear=Vector3(x=0.6), angular=Vector3(z=0.4)))
        found = shared.latest("odom/car").pose.pose.position
        return found.x > 0.5

    shared.listen("odom/car", Odometry)
    shared.wait_for(far)

    def at_rest() -> bool:
        parents = {one.child_frame_id: one.header.frame_id for message in received for one in message.transforms}
        [root] = [frame for frame, parent in parents.items() if parent == "odom"]
        assert parents["odom"] == "map"
        there, _ = buffer_of(*received).lookup("map", root)
        last = [one for one in truth if one.child_frame_id == root][-1].pose.pose.position
        return bool(np.allclose(there.translation, (last.x, last.y, last.z), atol=1e-3))

    shared.wait_for(at_rest)


def test_an_imu_of_a_link_comes_with_its_frame_and_covariances(shared: Probe) -> None:
    standing(shared, "husky", "car")
    found, root = shared.listen("imu/husky/imu_link", Imu), shared.listen("imu/car", Imu)
    shared.wait_for(lambda: len(found) > 60 and len(root) > 10)
    times = np.array([seconds(message.header.stamp) for message in found])
    assert (np.diff(times) >= 0.0).all()
    last = found[-1]
    assert last.header.frame_id.endswith("imu_link")
    assert root[-1].header.frame_id.endswith("base_link")
    assert last.linear_acceleration.z == pytest.approx(9.81, abs=0.1)
    np.testing.assert_allclose(last.angular_velocity_covariance, (0.002**2 * 60.0 * np.eye(3)).ravel(), rtol=1e-6)
    assert not np.any(last.linear_acceleration_covariance)


def test_commands_that_cannot_be_are_refused(domain: int) -> None:
    config = {"bases": ["{body: digger, tracks: [left_track, right_track]}"]}
    with fed({**config, "frame_id": "map"}) as node:
        twist = Twist(linear=Vector3(x=0.5))
        node.require_refused("cmd_vel/digger", [("unknown_body", twist)])
        node.world.terrain.put("", HeightMap(np.zeros((101, 101)), resolution=0.1, origin=(-5.0, -5.0)))
        node.world.spawn_robot("digger", UNDERCARRIAGE, BodyState(), on_ground=True)
        node.run(10)
        node.require_refused("cmd_vel/digger", [("non_finite", Twist(linear=Vector3(x=math.nan)))])
        late = TwistStamped(twist=twist)
        late.header.stamp = node.now()
        late.header.stamp.sec -= 5
        node.require_refused("cmd_vel_stamped/digger", [("stamp", late)])
        node.run(30)
        assert abs(node.world.base_state("digger").linear[0]) < 0.02
        node.give("cmd_vel_stamped/digger", TwistStamped(twist=twist), 100)
        assert node.world.base_state("digger").linear[0] == pytest.approx(0.5, abs=0.08)
        node.run(150)
        assert abs(node.world.base_state("digger").linear[0]) < 0.05


def test_imus_measure_for_subscribers_alone_and_steps_of_a_pause_have_their_own_stamps(domain: int) -> None:
    with fed({"imus": ["{body: box, rate: 120}"], "frame_id": "map", "publish.clock": 60.0}) as node:
        node.world.spawn("box", Box(0.3, 0.3, 0.3), 1.0, BodyState((0.0, 0.0, 50.0)))
        [output] = node.node._outputs._of_entries["imu"]
        node.run(10)
        assert not node.world.watchers
        found: list[Imu] = []
        count = 1
        output.publisher = SimpleNamespace(publish=found.append, get_subscription_count=lambda: count)
        node.run(2)
        found.clear()
        node.node.pause(True)
        start = node.world.time
        node.node.step(20)
        times = [seconds(message.header.stamp) - start for message in found]
        np.testing.assert_allclose(times, np.arange(1, 11) / 120.0, atol=1e-6)
        assert found[-1].header.frame_id == "box"
        count = 0
        node.node.step(1)
        assert not node.world.watchers
