"""Bases that drive by velocities, their odometry and frames, and IMUs."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from smartmesh_msgs.srv import StepPhysics
from std_srvs.srv import SetBool

from smartmesh_ros import BodyState, Box
from tests import urdfs
from tests.grounds import level
from tests.node.shared import fed, on_level, seconds
from tests.node.test_robot_outputs import buffer_of
from tests.world.test_bases import HINGES, RACECAR, REAR, UNDERCARRIAGE

CAR = (
    f"{{body: car, wheels: [{', '.join(REAR)}], steering: [{', '.join(HINGES)}], publish_tf: true, "
    "odom_frame: car/odom}"
)


def test_the_frame_of_a_robots_odometry_is_between_the_map_and_its_root_link() -> None:
    """As of REP 105: the chain map, odom, root link gives the true pose, whatever the odometry drifts. How all kinds of
    bases drive: tests/world/test_bases.py."""
    with on_level({"publish.tf": 30.0, "bases": [CAR]}, keep=["/tf", "odom/car"]) as run:
        run.run(0.1)
        run.world.spawn_robot("car", RACECAR, BodyState((5.0, 5.0, 0.0)), on_ground=True)
        for _ in range(10):
            run.give("cmd_vel_stamped/car", TwistStamped(twist=Twist(linear=Vector3(x=0.5), angular=Vector3(z=0.4))))
            run.run(run.time + 0.2)
        found = run.received("odom/car")[-1]
        assert (found.header.frame_id, found.child_frame_id) == ("car/odom", "base_link")
        assert found.pose.pose.position.x > 0.3
        assert (found.twist.twist.linear.x, found.twist.twist.angular.z) == pytest.approx((0.5, 0.4), abs=0.05)
        run.run(run.time + 1.5)
        assert abs(run.received("odom/car")[-1].twist.twist.linear.x) < 0.05
        frames = run.received("/tf")
        parents = {one.child_frame_id: one.header.frame_id for message in frames for one in message.transforms}
        assert (parents["base_link"], parents["car/odom"]) == ("car/odom", "map")
        there, _ = buffer_of(*frames).lookup("map", "base_link")
        assert there.translation == pytest.approx(run.world.base_state("car").position, abs=1e-3)


def test_an_imu_of_a_link_comes_with_its_frame_and_covariances() -> None:
    imus = ["{body: husky, link: imu_link, rate: 60, gyroscope_noise_density: 0.002}", "{body: car}"]
    topics = ("imu/husky/imu_link", "imu/car")
    with on_level({"imus": imus}, keep=topics) as run:
        run.run(0.1)
        for y, (name, urdf) in enumerate({"husky": urdfs.HUSKY, "car": RACECAR}.items(), 2):
            run.world.spawn_robot(name, urdf, BodyState((2.0, 2.0 * y, 0.0)), on_ground=True)
        run.run(1.5)
        last, root = (run.received(topic)[-1] for topic in topics)
        assert last.header.frame_id.endswith("imu_link") and root.header.frame_id.endswith("base_link")
        assert last.linear_acceleration.z == pytest.approx(9.81, abs=0.1)
        np.testing.assert_allclose(last.angular_velocity_covariance, (0.002**2 * 60.0 * np.eye(3)).ravel(), rtol=1e-6)
        assert not np.any(last.linear_acceleration_covariance)


def test_commands_that_cannot_be_are_refused() -> None:
    config = {"bases": ["{body: digger, tracks: [left_track, right_track]}"]}
    with fed({**config, "frame_id": "map"}) as node:
        twist = Twist(linear=Vector3(x=0.5))
        node.require_refused("cmd_vel/digger", [("unknown_body", twist)])
        node.world.terrain.put("", level(101))
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


def test_imus_measure_for_subscribers_alone_and_steps_of_a_pause_have_their_own_stamps() -> None:
    with on_level({"imus": ["{body: box, rate: 120}"], "publish.clock": 60.0}, keep=["imu/box"]) as run:
        run.world.spawn("box", Box(0.3, 0.3, 0.3), 1.0, BodyState((2.0, 2.0, 50.0)))
        run.run(0.1)
        assert run.call("pause", SetBool.Request(data=True)).success
        start, before = run.world.time, len(run.received("imu/box"))
        assert run.call("step", StepPhysics.Request(steps=20)).success
        found = run.received("imu/box")[before:]
        times = [seconds(message.header.stamp) - start for message in found]
        np.testing.assert_allclose(times, np.arange(1, 11) / 120.0, atol=1e-6)
        assert found[-1].header.frame_id == "box"
        assert run.world.watchers
        run.node.publishers["/terrain_collider/imu/box"].record = None  # nobody subscribes any more
        assert run.call("step", StepPhysics.Request(steps=1)).success
        assert not run.world.watchers
