"""Recorded bags played into the node."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from grid_map_msgs.msg import GridMap
from rclpy.serialization import deserialize_message
from smartmesh_msgs.msg import Heightmap
from std_srvs.srv import Trigger

from smartmesh_ros import HeightMap
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster as raster_from
from smartmesh_ros.tools.testing import Probe, assert_on_map, bags

SCRIPT = Path(__file__).parents[2] / "scripts" / "make_bag.py"
MAPPER = Path(__file__).parents[1] / "data" / "mapper"
PARAMETERS = {
    "terrain.motion": "hold",
    "bodies.odometry": ["rover=/odom"],
    "bodies.timeout": 60.0,
}


def make_bag(path: Path, storage: str) -> Path:
    subprocess.run([sys.executable, SCRIPT, path, "--storage", storage, "--seconds", "1"], check=True)
    return path


def last_map(bag: Path) -> Any:
    *_, last = (record for record in bags.read(bag) if record.topic.endswith("heightmap"))
    return deserialize_message(last.data, Heightmap)


def test_a_played_bag_puts_patches_on_its_maps(probe: Probe, tmp_path: Path) -> None:
    bag = make_bag(tmp_path / "waves", "mcap")
    last = last_map(bag)
    with probe.running(parameters=PARAMETERS):
        assert bags.play(bag, probe.node, probe.spin) == 80

        def on_last_map() -> bool:
            try:
                [points] = probe.patches().values()
                assert_on_map(points, last)
            except (AssertionError, ValueError):
                return False
            # Odometry goes from x = -1 to -0.5 and ends; a body is carried on by its twist for a little while.
            x, y, _ = points.mean(axis=0)
            return bool(-0.6 < x < 0.0 and abs(y - 0.5) < 0.06)

        probe.wait_for(on_last_map)
        # Played again, its stamps run backwards: refused, until the node is told to start anew.
        bags.play(bag, probe.node, probe.spin, rate=4.0)
        probe.wait_for(lambda: "refused, heightmap: stamp_backwards" in probe.diagnostics("inputs"))

        def taken_again() -> bool:  # on a slow machine maps come in bursts, of which only the newest are taken
            assert probe.call("reset", Trigger).success
            before = int(probe.diagnostics("terrain")["updates of ''"])
            bags.play(bag, probe.node, probe.spin)
            return int(probe.diagnostics("terrain")["updates of ''"]) > before + 10

        probe.wait_for(taken_again)
        probe.wait_for(on_last_map)


def test_the_shipped_bag_of_an_elevation_mapper_is_taken(probe: Probe) -> None:
    maps = [record for record in bags.read(MAPPER) if record.topic == "/elevation_map"]
    last = raster_from(deserialize_message(maps[-1].data, GridMap), RasterConfig())
    truth = HeightMap(last.heights, geometry=last.geometry)
    with probe.running(parameters={**PARAMETERS, "terrain.input": "grid_map"}):
        remap = {"/elevation_map": "/terrain_collider/grid_map"}
        assert bags.play(MAPPER, probe.node, probe.spin, rate=2.0, remap=remap) == 50

        def on_last_map() -> bool:
            points = np.concatenate([np.empty((0, 3)), *probe.patches().values()])
            below = truth.at(points[:, :2], 0.0).heights
            return bool(len(points) and np.allclose(points[:, 2], below, atol=1e-5))

        probe.wait_for(on_last_map)
        assert not [name for name in probe.diagnostics("inputs") if name.startswith("refused")]


def test_a_bag_gives_back_what_was_written(probe: Probe, tmp_path: Path) -> None:
    """Byte for byte, whatever padding is in it."""
    written = [
        ("/a", 1.0, probe.publish_map(np.ones((3, 4)), resolution=0.5)),
        ("/b", 1.5, probe.publish_map(np.zeros((5, 3)), resolution=0.5, tile="north")),
    ]
    for storage in ("mcap", "sqlite3"):
        bags.write(tmp_path / storage, written, storage)  # type: ignore[arg-type]
        records = list(bags.read(tmp_path / storage))
        assert [(record.topic, record.time) for record in records] == [("/a", 1.0), ("/b", 1.5)]
        for record, (_, _, message) in zip(records, written, strict=True):
            assert bags.class_of(record.type_name) is Heightmap
            assert deserialize_message(record.data, Heightmap) == message
