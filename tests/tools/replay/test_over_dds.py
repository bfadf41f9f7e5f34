"""A run of the node over DDS, with the calls of its services, recorded and replayed."""

from pathlib import Path
from time import time
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import Probe, bags
from tests.node.shared import position_of, spawn

PARAMETERS = {"service_introspection": "contents"}
RECORDED = {
    "heightmap": Heightmap, "body_states": TrackedBodyArray, "spawn_body/_service_event": SpawnBody.Event,
}  # fmt: skip


def test_a_recorded_run_is_replayed(probe: Probe, tmp_path: Path) -> None:
    """A ball comes to rest where it did. That the node does the same on any ground: test_replay.py."""
    records: list[tuple[str, float, Any]] = []

    def record(name: str, kind: Any) -> None:
        def note(data: bytes) -> None:
            records.append((probe.topic(name), time(), deserialize_message(data, kind)))

        probe.node.create_subscription(kind, probe.topic(name), note, 100, raw=True)

    with probe.running(parameters=PARAMETERS):
        for name, kind in RECORDED.items():
            record(name, kind)
        probe.wait_for(lambda: probe.node.count_publishers(probe.topic("spawn_body/_service_event")))
        probe.publish_map(np.zeros((21, 21)), resolution=0.5, origin=(-5.0, -5.0, 0.0))
        probe.wait_for(lambda: any(topic.endswith("heightmap") for topic, *_ in records))
        spawn(probe, "ball", (1.0, 0.5, 0.4))
        place = pytest.approx((1.0, 0.5, 0.2), abs=1e-3)
        probe.wait_for(lambda: position_of(probe, "ball") == place)
    bags.write(tmp_path / "bag", records)
    with Replay(tmp_path / "bag", PARAMETERS) as run:
        run.run()
        run.run(run.time + 1.0)
        assert not run.refused
        assert run.world.state("ball").position == place
