"""The shipped bag of an elevation mapper. Bags played over DDS: the page on testing, by test_tutorial.py."""

from pathlib import Path

import numpy as np
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from smartmesh_ros import HeightMap
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster
from smartmesh_ros.tools.testing import bags
from smartmesh_ros.tools.testing.replaying import replayed

MAPPER = Path(__file__).parents[1] / "data" / "mapper"
PARAMETERS = {"terrain.input": "grid_map", "terrain.motion": "hold", "bodies.odometry": ["rover=/odom"]}


def test_it_is_taken_and_after_a_reset_again() -> None:
    """Played again without a reset, its stamps run backwards."""
    records = list(bags.read(MAPPER))
    newest = {record.topic: record.data for record in records}
    last = grid_map_raster(deserialize_message(newest["/elevation_map"], GridMap), RasterConfig())
    place = deserialize_message(newest["/odom"], Odometry).pose.pose.position
    with replayed(MAPPER, PARAMETERS, remap={"~/grid_map": "/elevation_map"}) as run:

        def require_last() -> None:
            points = run.world.patches().table().points_of(0)
            heights = HeightMap(last.heights, geometry=last.geometry).at(points[:, :2], 0.0).heights
            np.testing.assert_allclose(points[:, 2], heights, atol=1e-5)
            np.testing.assert_allclose(points[:, :2].mean(axis=0), (place.x, place.y), atol=0.5)

        def play(pause: float) -> dict[str, int]:
            for record in records:
                run.run(run.time + pause)
                run.give(record.topic, record.data)
            return run.refused

        run.run()
        require_last()
        assert len(records) == 50 and not run.refused
        before = play(0.0)
        assert before.keys() == {"grid_map: stamp_backwards", "/odom: stamp_backwards"}
        assert run.call("reset", Trigger.Request()).success
        assert play(0.1) == before
        require_last()
