"""``/clock`` over DDS: published by the node, followed by the node, and never both."""

import math
from itertools import count
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from smartmesh_msgs.msg import Heightmap, TrackedBody, TrackedBodyArray
from smartmesh_msgs.srv import QueryGround
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Sphere
from smartmesh_ros.node.outputs.diagnostics import PaceWindow
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.tools.demo.terrain_source import TerrainSource
from smartmesh_ros.tools.testing import COLLIDER, Probe, heightmap_message
from smartmesh_ros.world.joints import JointCommand
from tests.node.shared import Fed, Log, Logged, changed, fed, made_with, on_level, seconds, spawn, transform_message
from tests.urdfs import joint, link, robot

HEIGHT, STEP = 1000.0, 1 / 240
# A body with a joint that moves along its x.
SLED = robot(
    link("base", mass=1e4, moment=1e4), link("arm", "", 1.0, 1.0),
    joint("j", "prismatic", "base", "arm", '<limit lower="-9" upper="9" effort="10" velocity="9"/>', axis="1 0 0"),
)  # fmt: skip


def set_clock(node: Fed, time: float) -> None:
    """Has a node hear a message of ``/clock`` [s], and run the steps that it releases."""
    node.node._time_source.clock_callback(Clock(clock=stamp_of(time)))
    while node.node.pacer.remaining() <= 0.0:
        node.node.tick(node.node.pacer.advance)


def test_a_clock_at_the_last_stamp_that_there_is_ends_no_node() -> None:
    """The states are a step ahead of it, and the core takes no later stamp."""
    with fed({"use_sim_time": True}) as node:
        set_clock(node, 2.0**31 - 0.001)
        assert node.node.session.stamp_now() == Time(sec=2**31 - 1, nanosec=999_999_999)


def test_a_map_that_comes_before_the_first_message_of_the_clock_is_of_no_other_clock(logged: Logged) -> None:
    with fed({"use_sim_time": True}) as node:
        message = heightmap_message(np.zeros((10, 10)))
        for first, words in ((100.0, False), (200.0, True)):  # the second one is ahead of a clock that runs
            message.header.stamp = stamp_of(first)
            node.give("heightmap", message, steps=0)
            set_clock(node, first)
            message.header.stamp = stamp_of(first + 0.01)
            node.give("heightmap", message, steps=0)
            said = logged()
            assert ("s ahead of this node's clock" in said) == words and "set use_sim_time" not in said
            assert ("its publisher needs use_sim_time, too" in said) == words
        assert not node.node.refusals.counts


def test_a_map_that_is_ahead_of_the_clock_that_the_node_publishes_is_told_who_is_to_follow_it(logged: Logged) -> None:
    with fed({"publish.clock": 100.0}) as node:
        node.give("heightmap", heightmap_message(np.zeros((10, 10)), stamp=node.now()))
        said = logged()
        assert "its publisher needs use_sim_time, too" in said and "set use_sim_time" not in said


def test_a_clock_of_few_messages_is_no_slow_physics_whenever_that_is_measured() -> None:
    """Each message releases 72 steps, and the measurement comes after some of them."""
    with fed({"use_sim_time": True}) as node:
        set_clock(node, 100.0)
        window = PaceWindow(node.node.session, node.node.session.clock.pace)
        factors = []
        for k in range(1, 40):
            node.node._time_source.clock_callback(Clock(clock=stamp_of(100.0 + 0.3 * k)))
            for step in range(72):
                if step == 17 * k % 72:
                    factors.append(window.read()[1])
                node.node.tick(node.node.pacer.advance)
        assert factors == pytest.approx([1.0] * 39, abs=0.02)


@pytest.mark.parametrize("period", [0.02, 0.1, 0.5])
def test_maps_that_overtake_the_clock_of_their_tick_keep_the_velocity_of_the_ground(period: float) -> None:
    """DDS keeps no order between topics."""
    speed, rng = 0.5, np.random.default_rng(0)
    with fed({"use_sim_time": True, "terrain.max_interval": 2.0}) as node:
        set_clock(node, 100.0)
        for k in range(1, 30):
            now = 100.0 + period * k
            message = heightmap_message(np.full((10, 10), speed * period * k), resolution=1.0)
            message.header.frame_id, message.header.stamp = "map", stamp_of(now + 1e-9)
            if early := rng.random() < 0.5:
                node.give("heightmap", message, 0)
            set_clock(node, now)
            if not early:
                node.give("heightmap", message, 0)
            if k > 3:
                [velocity] = node.world.terrain.at([[5.0, 5.0]], node.world.time).velocities
                assert velocity == pytest.approx(speed, rel=1e-3)


@pytest.mark.parametrize(("interval", "rate"), [(0.001, 50.0), (0.1, 48.0)])
def test_each_state_has_its_own_stamp_and_rates_count_simulated_time(interval: float, rate: float) -> None:
    """What flies at 1 m/s is where its stamps say, however many steps a message of the clock releases. Such a burst is
    no delay."""
    parameters = {
        "use_sim_time": True, "physics.gravity": [0.0, 0.0, 0.0], "publish.body_states": rate, "publish.tf": 20.0,
    }  # fmt: skip
    clock = [("/clock", k * interval, Clock(clock=stamp_of(1000.0 + k * interval))) for k in range(round(5 / interval))]
    with on_level(parameters, *clock, keep=["body_states", "odometry", "joint_states", "/tf"]) as run:
        run.world.spawn_robot("sled", SLED)
        run.world.move("sled", BodyState((0.0, 0.0, 2.0), linear=(1.0, 0.0, 0.0)))
        run.world.command("sled", "j", JointCommand(velocity=0.5))
        run.run()
        assert run.collider.pacer.misses == 0

        def require(found: list[tuple[Any, float]], speed: float, rate: float) -> None:
            """Stamps and places along x."""
            t, x = np.array([(seconds(stamp), x) for stamp, x in found if seconds(stamp) > 1002.0]).T
            assert np.ptp(x - speed * t) < 3e-4, "a step is 4 mm"
            assert np.diff(t) == pytest.approx(1.0 / rate, abs=1.01 * STEP if rate < 240.0 else 1e-6)
            assert len(t) == pytest.approx((t[-1] - 1002.0) * rate, abs=2) and t[-1] > 1004.7

        frames = [message.transforms[0] for message in run.received("/tf")]
        states = [(one.header.stamp, one.bodies[0].pose) for one in run.received("body_states") if one.bodies]
        require([(stamp, pose.position.x) for stamp, pose in states], 1.0, rate)
        require([(one.header.stamp, one.pose.pose.position.x) for one in run.received("odometry")], 1.0, rate)
        joints = [one for one in run.received("joint_states") if one.position]
        require([(one.header.stamp, one.position[0]) for one in joints], 0.5, rate)
        require([(one.header.stamp, one.transform.translation.x) for one in frames], 1.0, 20.0)
        assert {message.ahead for message in run.received("body_states")} == {0.0}


def test_what_waits_for_a_clock_says_so_and_publishes_to_new_subscribers_and_after_calls_alone(probe: Probe) -> None:
    """No state is told twice. Whoever comes while a simulator is paused sees what is there, and is answered."""
    with probe.running(parameters={"use_sim_time": True}) as process:
        spawn(probe, "ball", (0.0, 0.0, HEIGHT))
        seen = probe.received[f"{COLLIDER}/body_states"]
        probe.wait_for(lambda: seen and seen[-1].bodies)
        with Probe() as second:
            second.wait_for(lambda: second.received[f"{COLLIDER}/body_states"])
            words, before = "waits for /clock, which nobody publishes", len(seen)
            probe.wait_for(lambda: probe.diagnostics("physics")["message"] == words)
            assert len(seen) <= before + 1
            assert second.received[f"{COLLIDER}/body_states"][-1].bodies
        assert process.output.count(f"the physics {words}") == 1
        clock, time = probe.node.create_publisher(Clock, "/clock", 10), count(1000)

        def runs() -> bool:
            clock.publish(Clock(clock=Time(sec=next(time) // 20)))
            probe.spin(0.05)
            return "waits" not in probe.newest_diagnostics()["physics"]["message"]

        probe.wait_for(runs)
        probe.wait_for(lambda: probe.diagnostics("physics")["message"] == "waits for /clock, which stands still")
        start = float(next(time))
        for part in range(6):  # of the time between two steps
            clock.publish(Clock(clock=stamp_of(start + part * STEP / 6)))
            probe.spin(0.1)
            assert "map" in probe.call("query_ground", QueryGround).message


@pytest.mark.parametrize(("speed", "words"), [(0.4, "as fast as /clock"), (None, "slower than /clock (0.")])
def test_the_diagnostics_compare_the_physics_with_the_clock_that_it_follows(speed: float | None, words: str) -> None:
    """A simulator that is slower than real time is no fault of the node. None: jumps of more than a step may follow."""
    times = [100.0 + (speed * k / 50 if speed else 2.5 * (k // 25)) for k in range(300)]
    clock = [("/clock", k / 50, Clock(clock=stamp_of(time))) for k, time in enumerate(times)]
    with on_level({"use_sim_time": True}, *clock, keep=["/diagnostics"]) as run:
        run.run()
        found = [of.message for it in run.received("/diagnostics")[3:] for of in it.status if "physics" in of.name]
        assert len(found) > 1 and all(words in message for message in found)


@pytest.mark.parametrize("straggles", [False, True])
def test_nothing_of_before_stays_when_the_clock_goes_back(straggles: bool) -> None:
    """A recording in a loop with its clock: bodies of its end go after the time-out, and a message of its end that
    arrives after the jump shuts no later ones out, on any topic."""
    parameters = {
        "use_sim_time": True, "bodies.timeout": 1.0, "bodies.frames": ["framed=base_link"], "frame_id": "map",
        "bodies.odometry": ["driven=~/tracked_odometry"],
    }  # fmt: skip
    with fed(parameters) as node:
        bodies = node.world.bodies

        def refused() -> int:
            return sum(count for key, count in node.node.refusals.counts.items() if "stamp_backwards" in key)

        def send(at: float, *names: str) -> None:
            tracked = TrackedBodyArray(bodies=[TrackedBody(id=name, radius=0.2) for name in names])
            pose, moved = Odometry(), TransformStamped(child_frame_id="base_link")
            ground = heightmap_message(np.full((21, 21), 0.01 * (at % 1.0)), resolution=0.5)
            for header in (tracked.header, pose.header, moved.header, ground.header):
                header.stamp, header.frame_id = stamp_of(at), "map"
            frames = TFMessage(transforms=[moved])
            sent = {"tracked_bodies": tracked, "~/tracked_odometry": pose, "/tf": frames, "heightmap": ground}
            for topic, message in sent.items():
                node.give(topic, message, steps=0)

        def play(first: float, duration: float, *names: str) -> None:
            """Plays at 20 Hz from a time on, for so long [s]."""
            for tick in range(round(20.0 * duration)):
                set_clock(node, first + tick / 20.0)
                send(first + tick / 20.0, *names)

        play(5000.0, 1.0, "always", "ghost")
        assert bodies.keys() == {"always", "ghost", "driven", "framed"}
        assert refused() == 0
        if straggles:
            set_clock(node, 1000.0)
            send(5001.0, "always")
        play(1000.3, 1.5, "always")
        assert bodies.keys() == {"always", "driven", "framed"}
        lost, updates = refused(), node.world.terrain.tiles[""].version
        play(1010.0, 1.5, "always")
        assert bodies.keys() == {"always", "driven", "framed"}
        assert refused() == lost <= 8
        assert node.world.terrain.tiles[""].version == updates + 30


def test_clock_is_simulated_time_and_so_are_the_stamps_none_of_which_a_frame_has_twice() -> None:
    """Also when the physics is paused: tf2 would warn."""
    spawned = f"{{id: ball, shape: sphere, size: [0.2], xyz: [0, 0, {HEIGHT}]}}"
    parameters = {"publish.clock": 240.0, "publish.tf": 50.0, "bodies.spawn": [spawned]}
    with on_level(parameters, keep=["/clock", "/tf", "body_states"]) as run:
        run.run(2.0)
        times = [seconds(message.clock) for message in run.received("/clock")]
        assert times == sorted(times) and times[0] < 1.0 and times[-1] == pytest.approx(2.0, abs=2 * STEP)
        states = run.received("body_states")
        fallen = [(2.0 * (HEIGHT - one.bodies[0].pose.position.z) / 9.81) ** 0.5 for one in states]
        assert [seconds(one.header.stamp) for one in states] == pytest.approx(fallen, abs=2 * STEP)
        assert run.call("pause", SetBool.Request(data=True)).success
        run.run(3.0)
        stamps = [seconds(message.transforms[0].header.stamp) for message in run.received("/tf")]
        assert stamps and len({*stamps}) == len(stamps)


def test_stamps_are_of_another_clock_once_the_node_publishes_its_own() -> None:
    with fed({"bodies.frames": ["cart"], "frame_id": "map"}) as node:
        for rate in (0.0, 100.0, 0.0):
            assert not node.set("publish.clock", rate)
            cart = transform_message(node, "map", "cart")
            cart.header.stamp = node.node.session.stamp_now()
            node.give("/tf", TFMessage(transforms=[cart]))
            assert "cart" in node.world.bodies
        assert not node.node.refusals.counts


@pytest.mark.parametrize("own", [True, False])
def test_own_frames_that_arrive_after_the_clock_was_set_back_are_no_fault_of_a_source(own: bool) -> None:
    with fed({"publish.tf": 50.0, "frame_id": "map"}) as node:
        node.run(1)  # subscribes
        for time in (158.0, 10.0, 0.0):
            link = transform_message(node, "map", "link")
            link.header.stamp = stamp_of(time)
            message = TFMessage(transforms=[link])
            if own:
                node.node._transforms.note_own(serialize_message(message))
            node.give("/tf", message)
        assert node.node._transforms.is_own("link") == own
        assert node.node.refusals.counts["/tf: stamp_backwards"] == (not own)
        assert node.node.session.counts["without stamp on /tf"] == (not own)


def test_the_node_is_silent_while_another_publishes_the_clock(shared: Probe, log: Log) -> None:
    clocks: list[Clock] = []
    shared.node.create_subscription(Clock, "/clock", clocks.append, 100)
    with changed(shared, {"publish.clock": 100.0}):
        shared.wait_for(lambda: clocks)
        rival = shared.node.create_publisher(Clock, "/clock", 10)
        shared.wait_for(lambda: "silent on /clock" in shared.diagnostics("connections")["message"])
        shared.wait_for(lambda: shared.diagnostics("connections")["/clock is also published by"] == "/probe")
        shared.wait_for(lambda: log("published by /probe already"))
        clocks.clear()
        shared.latest("/diagnostics")
        assert not clocks
        shared.node.destroy_publisher(rival)
        shared.wait_for(lambda: clocks)
        shared.wait_for(lambda: "silent" not in shared.diagnostics("connections")["message"])


def test_an_overloaded_node_goes_on_by_its_policy(now: list[float]) -> None:
    """With *skip* simulated time does not fall behind although bodies do. What each policy does: test_pacing.py."""
    with fed({"physics.deadline": "skip", "physics.gravity": [0.0, 0.0, 0.0]}) as node:
        node.node.pacer.restart()
        node.world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 2.0), linear=(1.0, 0.0, 0.0)))

        def work() -> None:
            now[0] += 3.0 * STEP

        node.play(now, 1.0, 0.0, work)
        assert node.world.time == pytest.approx(now[0] - 1000.0, abs=4.0 * STEP)
        assert node.world.state("ball").position[0] == pytest.approx(node.world.time / 3.0, rel=0.05)
        assert node.node.pacer.misses > 0


def test_a_source_begins_with_the_clock_and_shows_a_whole_map_when_it_goes_back() -> None:
    """A rut as long as all years since 1970 would need 127 GiB."""
    with made_with(TerrainSource, {"scene": "rut", "mode": "regions", "use_sim_time": True}) as node:
        published = list[Any]()
        for name in ("_maps", "_regions"):
            setattr(node, name, SimpleNamespace(publish=published.append, get_subscription_count=lambda: 0))
        for time in (1.7e9, 1.7e9 + 2.0, 1.7e9 + 1.0, 10.0, 11.0, 17.0):
            node._time_source.clock_callback(Clock(clock=stamp_of(time)))
            node._tick()
    whole = [isinstance(message, Heightmap) for message in published]
    assert whole == [True, False, True, True, False, True]


def test_a_tracked_body_times_out_as_soon_at_few_steps_a_second(now: list[float]) -> None:
    """The time between two steps is no stall."""
    with fed({"physics.rate": 1.0, "bodies.timeout": 2.0, "frame_id": "map"}) as node:
        body = TrackedBodyArray(bodies=[TrackedBody(id="crane")])
        node.play(now, 3.0, 1.0, lambda: node.give("tracked_bodies", body, 0))
        assert node.world.bodies
        node.play(now, 4.0, math.inf, lambda: None)
        assert not node.world.bodies
