"""A run of the node over DDS, with the calls of its services, recorded and replayed."""

from pathlib import Path
from time import time
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray
from smartmesh_msgs.srv import SpawnBody

from smartmesh_ros.tools.testing import Probe, bags
from smartmesh_ros.tools.testing.replaying import replayed
from tests.node.shared import position_of, spawn

PARAMETERS = {"service_introspection": "contents"}
RECORDED = {
    "heightmap": Heightmap, "body_states": TrackedBodyArray, "spawn_body/_service_event": SpawnBody.Event,
}  # fmt: skip
SHAPES = (
    SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.2]),
    SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.4, 0.3, 0.2]),
    SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.3, 0.2]),
)


def test_a_recorded_run_is_replayed(probe: Probe, tmp_path: Path) -> None:
    """Bodies come to rest where they did."""
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
        for number, shape in enumerate(SHAPES):
            spawn(probe, f"body_{number}", (2.0 * number - 2.0, 0.5, 0.4), shape=shape)
        places = {}

        def at_rest() -> bool:
            bodies = probe.latest("body_states").bodies
            places.update({body.id: position_of(probe, body.id) for body in bodies})
            return len(bodies) == 3 and all(abs(body.twist.linear.z) < 1e-4 for body in bodies)

        probe.wait_for(at_rest)
    bags.write(tmp_path / "bag", records)
    with replayed(tmp_path / "bag", PARAMETERS) as run:
        run.run()
        assert not run.refused
        for name, place in places.items():
            assert run.world.state(name).position == pytest.approx(place, abs=1e-3)
