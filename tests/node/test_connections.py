"""Peers in other processes whose quality of service does not fit are named, with the policy."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from smartmesh_msgs.msg import ContactArray, Heightmap, Timing

from smartmesh_ros.startup.dds import POLICY_VARIABLE, VARIABLE, use_large_message_profile
from smartmesh_ros.tools.testing import COLLIDER, Probe, Process
from tests.node.shared import LATCHED, seconds

# Size of the shared memory that the profile asks for [bytes].
SEGMENT = 128 * 1024**2


def test_a_peer_with_incompatible_qos_is_named_with_the_policy(probe: Probe) -> None:
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    with probe.running():
        assert probe.diagnostics("connections")["message"] == "no incompatible QoS"
        stubborn = rclpy.create_node("stubborn", context=probe.context)
        stubborn.create_publisher(Heightmap, f"{COLLIDER}/heightmap", best_effort)
        stubborn.create_subscription(ContactArray, f"{COLLIDER}/contacts", print, LATCHED)

        def named() -> Any:
            found = probe.diagnostics("connections")
            words = "incompatible QoS on"
            return words in found["message"] and sum(key.startswith(words) for key in found) == 2 and found

        values = probe.wait_for(named)
        stubborn.destroy_node()
        maps, contacts = (values[f"incompatible QoS on {COLLIDER}/{topic}"] for topic in ("heightmap", "contacts"))
        assert "/stubborn" in maps and "reliable" in maps
        assert "/stubborn" in contacts and "transient local" in contacts.lower()
        assert "/probe" not in str(values)


def test_latched_outputs_reach_late_joiners(probe: Probe) -> None:
    """As many of the last messages as the depth says."""
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    overrides = {"/terrain_collider/timing": {"publisher": {"depth": 3}}}
    with probe.running(parameters={"publish.durability": "transient_local", "qos_overrides": overrides}):
        probe.publish_map(np.zeros((20, 20)))
        probe.publish_poses([(1.0, 1.0, 0.1)])
        assert probe.wait_for(probe.patches)
        late: list[Timing] = []
        probe.latest("timing")
        probe.latest("timing")
        probe.latest("timing")
        newest = probe.latest("timing").header.stamp
        probe.node.create_subscription(Timing, f"{COLLIDER}/timing", late.append, latched)
        probe.wait_for(lambda: late and seconds(late[-1].header.stamp) > seconds(newest))
        before = [message for message in late if seconds(message.header.stamp) <= seconds(newest)]
        assert 2 <= len(before) <= 3


def test_large_maps_go_through_with_the_installed_profile(probe: Probe, monkeypatch: pytest.MonkeyPatch) -> None:
    """Source and collider use it, the probe does not: peers with and without it understand each other."""
    for name in (VARIABLE, POLICY_VARIABLE):  # set anew below, and as they were after the test
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    use_large_message_profile()
    # Slowly: the source keeps only its newest map, so that one that is still on its way is given up for the next.
    source = {"rows": 2048, "columns": 2048, "rate": 0.5, "resolution": 0.05}
    with probe.running() as collider, Process("terrain_source", source):
        probe.wait_for(lambda: int(probe.diagnostics("terrain").get("updates of ''", 0)) >= 3)
        assert probe.diagnostics("terrain")["samples"] == str(2048 * 2048)
        lines = Path(f"/proc/{collider.process.pid}/maps").read_text().splitlines()
        segments = [line.split()[0].split("-") for line in lines if "/dev/shm/fastrtps_" in line]
        # Its own and the source's.
        assert sum(int(end, 16) - int(start, 16) >= SEGMENT for start, end in segments) >= 2
        assert "XMLPARSER" not in collider.output
