"""Peers, clocks, disks and wires that fail."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from smartmesh_msgs.msg import Heightmap
from visualization_msgs.msg import MarkerArray

from smartmesh_ros.tools.client import Patch, PatchClient, TrackedLink
from smartmesh_ros.tools.testing import COLLIDER, TIMEOUT, Probe, Process, assert_on_map, heightmap_message
from tests.node.shared import LATCHED, refusals, seconds

SHAPE = (40, 30)
SHARED = {"terrain.motion": "hold"}


def rough(seed: int, base: float = 0.0) -> np.ndarray[Any, np.dtype[np.float64]]:
    return base + np.random.default_rng(seed).normal(size=SHAPE) * 0.1


def on_map(probe: Probe, message: Heightmap) -> Callable[[], bool]:
    """Whether there are patches, all of whose vertices are samples of the map."""

    def holds() -> bool:
        probe.publish_poses([(1.0, 1.0, 0.3)])
        patches = probe.patches()
        try:
            for points in patches.values():
                assert_on_map(points, message)
        except AssertionError:
            return False
        return bool(patches)

    return holds


def test_two_sources_of_one_terrain_never_mix(shared: Probe) -> None:
    """The newest map holds, whoever sent it: every patch lies wholly on one of the two."""
    other = shared.publisher(Heightmap, "heightmap")
    first, second = rough(1), rough(2, base=5.0)
    shared.publish_map(first)
    shared.wait_for(on_map(shared, heightmap_message(first)))
    seen = set()

    def both_seen() -> bool:
        shared.publish_poses([(1.0, 1.0, 0.3)])
        if np.random.default_rng().random() < 0.5:
            shared.publish_map(first)
        else:
            other.publish(heightmap_message(second, stamp=shared.now()))
        for points in shared.patches().values():
            of = int(points[:, 2].max() > 2.0)
            assert_on_map(points, heightmap_message((first, second)[of]))
            seen.add(of)
        return len(seen) == 2

    shared.wait_for(both_seen)
    last = shared.publish_map(first)
    shared.wait_for(on_map(shared, last))
    shared.node.destroy_publisher(other)


def test_a_stamp_far_ahead_does_not_shut_out_the_right_ones_after_it(shared: Probe) -> None:
    """The node's own time goes on through all of it. Stamps from the past: test_refusals.py and test_real_maps.py."""
    before = refusals(shared)
    for ahead in (0, 100_000, 0):
        stamp = shared.now()
        stamp.sec += ahead
        shared.wait_for(on_map(shared, shared.publish_map(rough(ahead), stamp=stamp)))
    assert refusals(shared) == before
    shared.wait_for(lambda: shared.latest("timing").real_time_factor > 0.0)


def test_a_node_that_was_killed_comes_back_with_the_latched_map(udp_only: None, probe: Probe) -> None:
    map_message = heightmap_message(rough(1))
    keeper = probe.node.create_publisher(Heightmap, f"{COLLIDER}/heightmap", LATCHED)
    keeper.publish(map_message)
    overrides = {f"{COLLIDER}/heightmap": {"subscription": {"durability": "transient_local"}}}
    settings = {"qos_overrides": overrides, "terrain.motion": "hold"}
    for _ in range(2):
        with Process("terrain_collider", settings) as process:
            probe.wait_for(on_map(probe, map_message), watch=process)
            process.process.send_signal(signal.SIGKILL)
            assert process.process.wait(TIMEOUT) == -signal.SIGKILL
    probe.node.destroy_publisher(keeper)


def test_a_subscriber_that_reads_nothing_does_not_slow_the_node(
    shared: Probe, shared_node: tuple[Probe, Process]
) -> None:
    """Its queue overflows at its own end; everybody else goes on receiving."""
    with Probe(shared.namespace) as hog:
        hog.node.create_subscription(MarkerArray, shared.topic("patches"), lambda _: None, 1)
        shared.wait_for(lambda: shared.node.count_subscribers(shared.topic("patches")) >= 3)
        good = shared.publish_map(rough(1))
        shared.wait_for(on_map(shared, good))
        before = float(shared.latest("timing").window_s)
        received = len(shared.received[shared.topic("patches")])
        shared.wait_for(lambda: len(shared.received[shared.topic("patches")]) > received + 60)
        assert before > 0.0
        assert shared_node[1].process.poll() is None


def test_the_node_runs_where_no_log_can_be_written(probe: Probe, tmp_path: Path) -> None:
    """On a full disk. Where there can be no folder: test_processes.py."""
    with full_disk(tmp_path) as logs, probe.running(environment={"ROS_LOG_DIR": str(logs)}) as process:
        good = probe.publish_map(rough(1))
        probe.wait_for(on_map(probe, good), watch=process)
        # A refusal is logged, which needs the disk.
        probe.publish_map(np.zeros((2, 2)))
        probe.wait_for(lambda: "refused, heightmap: geometry" in probe.diagnostics("inputs"))
        assert process.stop() == 0


@contextlib.contextmanager
def full_disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "small"
    folder.mkdir()
    if os.system(f"mount -t tmpfs -o size=4k tmpfs {folder} 2>/dev/null") != 0:
        pytest.skip("mounting a small file system is not permitted here")
    try:
        with contextlib.suppress(OSError):
            (folder / "ballast").write_bytes(bytes(8192))
        yield folder
    finally:
        os.system(f"umount {folder}")


def test_a_parameter_of_no_type_is_refused_and_the_node_lives(
    shared: Probe, shared_node: tuple[Probe, Process]
) -> None:
    client = shared.node.create_client(SetParameters, shared.topic("set_parameters"))
    shared.wait_for(client.service_is_ready)
    client.call_async(SetParameters.Request(parameters=[Parameter(name="physics.rate", value=ParameterValue(type=77))]))
    shared.wait_for(lambda: "refused, rclpy: malformed" in shared.diagnostics("inputs"), watch=shared_node[1])
    good = shared.publish_map(rough(1))
    shared.wait_for(on_map(shared, good))


def test_ground_that_rises_slowly_throws_nothing_when_a_stalled_node_goes_on(probe: Probe) -> None:
    """The node stands still while its ground rises by 10 cm, which it must not take for the motion of some steps: that
    would be 3 m/s. On a machine that is too busy ground moves faster by as much as simulated time is slower. How exact
    velocities are where it is not: test_pacing.py."""
    speed, start = 0.1, seconds(probe.now())
    link = TrackedLink(name="wheel", position=(2.0, 2.0, 0.0), radius=0.3)

    def risen() -> float:
        return speed * (seconds(probe.now()) - start)

    with probe.running() as node, PatchClient(COLLIDER) as client:

        def patch() -> Patch | None:
            now = probe.now()
            probe.publish_map(np.full((40, 40), speed * (seconds(now) - start)), resolution=0.1, stamp=now)
            client.track([link])
            client.spin_once(1 / 30)
            return client.patch("wheel")

        def rises(patch: Patch | None) -> bool:
            return patch is not None and patch.linear_w[2] == pytest.approx(speed, rel=0.2)

        probe.wait_for(lambda: rises(patch()), watch=node)
        for _ in range(3):
            before = risen()
            node.process.send_signal(signal.SIGSTOP)
            try:
                probe.wait_for(lambda: patch() is not None and risen() > before + 0.1)  # noqa: B023
            finally:
                node.process.send_signal(signal.SIGCONT)
            seen: list[float] = []

            def goes_on() -> bool:
                found = patch()
                if found is None or found.vertices_w[:, 2].max() < before + 0.1:  # noqa: B023
                    return False
                seen.append(float(found.linear_w[2]))  # noqa: B023
                return len(seen) > 10 and rises(found)  # noqa: B023

            probe.wait_for(goes_on, watch=node)
            assert max(seen) <= 10.0 * speed
