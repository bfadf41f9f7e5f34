"""A recorded bag played into the node."""

from pathlib import Path

import numpy as np
import pytest
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from smartmesh_ros import HeightMap
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster as raster_from
from smartmesh_ros.tools.testing import Probe, bags

MAPPER = Path(__file__).parents[1] / "data" / "mapper"
PARAMETERS = {
    "terrain.input": "grid_map",
    "terrain.motion": "hold",
    "bodies.odometry": ["rover=/odom"],
    "bodies.timeout": 60.0,
}


def test_the_shipped_bag_of_an_elevation_mapper_is_taken_and_after_a_reset_again(probe: Probe) -> None:
    records = list(bags.read(MAPPER))
    maps = [record for record in records if record.topic == "/elevation_map"]
    last = raster_from(deserialize_message(maps[-1].data, GridMap), RasterConfig())
    truth = HeightMap(last.heights, geometry=last.geometry)
    *_, rover = (record for record in records if record.topic == "/odom")
    place = deserialize_message(rover.data, Odometry).pose.pose.position
    refused = "refused, grid_map: stamp_backwards"

    def play(rate: float) -> None:
        remap = {"/elevation_map": "/terrain_collider/grid_map"}
        assert bags.play(MAPPER, probe.node, probe.spin, rate=rate, remap=remap) == len(records) == 50

    def on_last_map() -> bool:
        points = np.concatenate([np.empty((0, 3)), *probe.patches().values()])
        below = truth.at(points[:, :2], 0.0).heights
        on_map = len(points) and np.allclose(points[:, 2], below, atol=1e-5)
        # A body is carried on by its twist for a little while after the last odometry.
        return bool(on_map and np.allclose(points[:, :2].mean(axis=0), (place.x, place.y), atol=0.5))

    with probe.running(parameters=PARAMETERS):
        play(2.0)
        probe.wait_for(on_last_map)
        assert not [name for name in probe.diagnostics("inputs") if name.startswith("refused")]
        # Played again, its stamps run backwards: refused, until the node is told to start anew.
        play(10.0)
        probe.wait_for(lambda: refused in probe.diagnostics("inputs"))
        assert probe.call("reset", Trigger).success
        before = probe.diagnostics("inputs")[refused]
        play(2.0)
        probe.wait_for(on_last_map)
        assert probe.diagnostics("inputs")[refused] == before


def test_a_topic_that_nobody_subscribes_to_is_named(probe: Probe) -> None:
    with pytest.raises(AssertionError, match=r"nobody subscribes to /.* after 0.5 s; remap renames topics"):
        bags.play(MAPPER, probe.node, probe.spin, timeout=0.5)
