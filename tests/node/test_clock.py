"""``/clock`` over DDS: published by the node, followed by the node, and never both."""

from itertools import count
from time import monotonic
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from smartmesh_msgs.msg import TrackedBody, TrackedBodyArray
from tf2_msgs.msg import TFMessage

from smartmesh_ros.tools.testing import COLLIDER, TIMEOUT, Probe, Process
from tests.node.shared import changed, seconds, set_parameters, spawn

HEIGHT, GRAVITY, STEP = 1000.0, 9.81, 1 / 240


def stamp_of(time: float) -> Time:
    return Time(sec=int(time), nanosec=int(time % 1.0 * 1e9))


def spawn_falling(probe: Probe) -> None:
    """A ball that falls freely, once it is seen: its height says how much time was simulated."""
    spawn(probe, "ball", (0.0, 0.0, HEIGHT))
    # States of before, without a ball, may come after the answer.
    probe.wait_for(lambda: probe.latest("body_states").bodies)


def fallen(message: Any) -> float:
    """Seconds that the ball of a ``body_states`` message has fallen for."""
    return float((2.0 * (HEIGHT - message.bodies[0].pose.position.z) / GRAVITY) ** 0.5)


def test_with_use_sim_time_the_physics_follows_the_clock(probe: Probe) -> None:
    publisher = probe.node.create_publisher(Clock, "/clock", 10)
    now = [0.0]

    def publish_clock() -> None:
        publisher.publish(Clock(clock=stamp_of(now[0])))

    def set_clock(time: float) -> None:
        """Sets the clock to another time [s] and waits until the node has it."""
        now[0] = time

        def taken() -> bool:
            publish_clock()
            probe.spin()
            return abs(seconds(states[-1].header.stamp) - time) < 1.0

        probe.wait_for(taken)

    def spun_on(until: Any) -> Any:
        """Lets time pass, in steps of 20 ms that come as they come, until the condition holds; never so fast that
        simulated time falls behind the clock by more than the node makes up for."""
        clock, simulated = now[0], fallen(states[-1])

        def condition() -> Any:
            if now[0] - clock - (fallen(states[-1]) - simulated) < 0.2:
                now[0] += 0.02
                publish_clock()
            probe.spin()
            return until()

        return probe.wait_for(condition)

    with probe.running(parameters={"use_sim_time": True, "publish.body_states": 1000.0}):
        probe.wait_for(publisher.get_subscription_count)
        spawn_falling(probe)
        states = probe.received[f"{COLLIDER}/body_states"]
        # Time stands still until the clock runs: the ball hangs in the air.
        seen = len(states)
        probe.wait_for(lambda: len(states) > seen + 3)
        assert states[-1].bodies[0].pose.position.z == HEIGHT
        set_clock(5000.0)
        spun_on(lambda: fallen(states[-1]) > 0.2)
        # Neither the time before the first message of the clock nor the bursts that its messages bring are delays.
        assert probe.diagnostics("physics")["deadline misses"] == "0"
        # It stands still again when the clock does, at the clock's time.
        probe.latest("/diagnostics")
        probe.latest("/diagnostics")
        start = states[-1]
        assert seconds(start.header.stamp) == pytest.approx(now[0], abs=1e-6)
        spun_on(lambda: fallen(states[-1]) > fallen(start) + 0.5)
        probe.latest("/diagnostics")
        probe.latest("/diagnostics")
        end = states[-1]
        assert seconds(end.header.stamp) == pytest.approx(now[0], abs=1e-6)
        passed = seconds(end.header.stamp) - seconds(start.header.stamp)
        assert fallen(end) - fallen(start) == pytest.approx(passed, abs=3 * STEP)
        # A simulator that starts anew sets its clock back; the physics goes on from there.
        set_clock(10.0)
        before = fallen(end)
        spun_on(lambda: fallen(states[-1]) > before + 0.2)
        probe.latest("/diagnostics")
        assert fallen(states[-1]) - before <= now[0] - 10.0 + 3 * STEP


def test_what_waits_for_a_clock_that_nobody_publishes_says_so(probe: Probe) -> None:
    with probe.running(parameters={"use_sim_time": True}) as process:
        words = "waits for /clock, which nobody publishes"
        probe.wait_for(lambda: probe.diagnostics("physics")["message"] == words)
        assert process.output.count(f"the physics {words}") == 1
        clock = probe.node.create_publisher(Clock, "/clock", 10)
        time = count(1000)

        def runs() -> bool:
            clock.publish(Clock(clock=Time(sec=next(time) // 20)))
            probe.spin(0.05)
            return "clock" not in probe.newest_diagnostics()["physics"]["message"]

        probe.wait_for(runs)
        probe.wait_for(lambda: probe.diagnostics("physics")["message"] == "waits for /clock, which stands still")


@pytest.mark.parametrize("straggles", [False, True])
def test_nothing_of_before_stays_when_the_clock_goes_back(probe: Probe, straggles: bool) -> None:
    """A recording in a loop with its clock: bodies of its end go after the time-out, and a message of its end that
    arrives after the jump shuts no later ones out, on any topic."""
    parameters = {
        "use_sim_time": True, "bodies.timeout": 1.0, "bodies.frames": ["framed=base_link"], "frame_id": "map",
        "bodies.odometry": ["driven=~/tracked_odometry"],
    }  # fmt: skip
    with probe.running(parameters=parameters):
        clock, frames = probe.node.create_publisher(Clock, "/clock", 10), probe.publisher(TFMessage, "/tf")
        odometry = probe.publisher(Odometry, "tracked_odometry")

        def send(at: float, *bodies: str) -> None:
            message = TrackedBodyArray(bodies=[TrackedBody(id=name, radius=0.2) for name in bodies])
            pose, moved = Odometry(), TransformStamped(child_frame_id="base_link")
            for header in (message.header, pose.header, moved.header):
                header.stamp, header.frame_id = stamp_of(at), "map"
            probe.publishers["tracked_bodies"].publish(message)
            odometry.publish(pose)
            frames.publish(TFMessage(transforms=[moved]))
            probe.publish_map(np.full((21, 21), 0.01 * (at % 1.0)), resolution=0.5, stamp=stamp_of(at))

        def play(first: float, until: Any, *bodies: str) -> float:
            """Plays from a time [s] on until the condition holds; the time reached [s]."""
            at, start = first, monotonic()

            def condition() -> Any:
                nonlocal at
                at = first + monotonic() - start
                clock.publish(Clock(clock=stamp_of(at)))
                send(at, *bodies)
                probe.spin(0.02)
                return until()

            probe.wait_for(condition)
            return at

        def tracked() -> str:
            return probe.newest_diagnostics()["bodies"]["tracked"]

        def refused() -> int:
            counts = probe.newest_diagnostics()["inputs"]
            return sum(int(count) for key, count in counts.items() if "stamp_backwards" in key)

        end = play(5000.0, lambda: tracked() == "4", "always", "ghost")
        before, played = refused(), monotonic()
        if straggles:
            back = monotonic()
            while monotonic() < back + 0.3:  # the node has the clock's new time
                clock.publish(Clock(clock=stamp_of(1000.0 + monotonic() - back)))
                probe.spin(0.02)
            send(end, "always")
        play(1000.3, lambda: monotonic() > played + 1.5 and tracked() == "3", "always")
        updates = int(probe.newest_diagnostics()["terrain"]["updates of ''"])
        lost = refused() - before
        play(1010.0, lambda: int(probe.newest_diagnostics()["terrain"]["updates of ''"]) > updates + 20, "always")
        assert tracked() == "3"
        assert refused() - before == lost <= 8, probe.newest_diagnostics()["inputs"]


def test_clock_is_simulated_time_and_so_are_the_stamps(shared: Probe) -> None:
    clocks: list[Clock] = []
    shared.node.create_subscription(Clock, "/clock", clocks.append, 100)
    with changed(shared, {"publish.clock": 240.0}):
        spawn_falling(shared)
        shared.wait_for(lambda: len(clocks) > 200)
        times = [seconds(message.clock) for message in clocks]
        assert times == sorted(times)
        assert times[-1] < 1e6, "simulated time starts at zero, not at the epoch"
        first, last = shared.latest("body_states"), shared.latest("body_states")
        while fallen(last) - fallen(first) < 0.5:
            last = shared.latest("body_states")
        simulated = seconds(last.header.stamp) - seconds(first.header.stamp)
        assert simulated == pytest.approx(fallen(last) - fallen(first), abs=2 * STEP)
        assert times[0] <= seconds(last.header.stamp) <= seconds(shared.wait_for(lambda: clocks[-1]).clock) + 1.0


def test_the_node_is_silent_while_another_publishes_the_clock(
    shared: Probe, shared_node: tuple[Probe, Process]
) -> None:
    clocks: list[Clock] = []
    shared.node.create_subscription(Clock, "/clock", clocks.append, 100)
    with changed(shared, {"publish.clock": 100.0}):
        shared.wait_for(lambda: clocks)
        rival = shared.node.create_publisher(Clock, "/clock", 10)
        shared.wait_for(lambda: "silent on /clock" in shared.diagnostics("connections")["message"])
        shared.wait_for(lambda: shared.diagnostics("connections")["/clock is also published by"] == "/probe")
        shared.wait_for(lambda: "published by /probe already" in shared_node[1].output)
        clocks.clear()
        shared.latest("/diagnostics")
        assert not clocks
        shared.node.destroy_publisher(rival)
        shared.wait_for(lambda: clocks)
        shared.wait_for(lambda: "silent" not in shared.diagnostics("connections")["message"])


def test_a_node_does_not_follow_its_own_clock(shared: Probe) -> None:
    with changed(shared, {"publish.clock": 10.0}):
        result = set_parameters(shared, {"use_sim_time": True})
        assert not result.successful and "publish.clock" in result.reason


def test_an_overloaded_node_goes_on_by_its_policy(shared: Probe) -> None:
    """At 10,000 steps a second no machine keeps up: with *skip* the clock does not fall behind although bodies do. What
    each policy does: test_pacing.py."""
    with changed(shared, {"physics.deadline": "skip", "physics.rate": 10_000.0, "publish.clock": 100.0}):
        spawn_falling(shared)
        first = shared.latest("body_states")
        # On a busy machine *skip* may make only some ten steps a second.
        last = shared.wait_for(
            lambda: (m := shared.latest("body_states")) and fallen(m) - fallen(first) > 0.1 and m, timeout=5 * TIMEOUT
        )
        clock = seconds(last.header.stamp) - seconds(first.header.stamp)
        assert clock >= fallen(last) - fallen(first) - 1e-3
        assert int(shared.diagnostics("physics")["deadline misses"]) > 0
