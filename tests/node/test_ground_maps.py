"""Maps of the true ground, and scores of a mapper against them."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from grid_map_msgs.msg import GridMap
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2

from smartmesh_ros import BodyState, Box, Deck, HeightMap, World
from smartmesh_ros.io.rasters import RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map_raster
from smartmesh_ros.node.outputs import scan_outputs
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.tools.score.terrain_score import TerrainScore
from smartmesh_ros.tools.testing import Probe
from tests.grid_maps import grid_map_message
from tests.node.shared import fed, made_with, seconds
from tests.node.test_ground_services import HILLS, LOW, RESOLUTION

SIZE, SPACING = (3.0, 2.0), 0.25


def test_a_ground_map_is_the_ground_in_the_layout_of_grid_map(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = f"{{body: 1 ball, size: {[*SIZE]}, spacing: {SPACING}, rate: 10}}"
    with fed({"frame_id": "map", "ground_maps": [entry, "{body: nobody}"]}) as node:
        heights, friction = HILLS.copy(), np.random.default_rng(0).uniform(0.2, 1.0, HILLS.shape)
        heights[40, 45] = np.nan
        terrain = node.world.terrain
        for time, rise in ((0.0, 0.0), (0.1, 0.05)):
            terrain.put("", HeightMap(heights + rise, resolution=RESOLUTION, origin=(LOW, LOW), time=time,
                                      friction=friction))  # fmt: skip
        deck = Deck(HeightMap(np.zeros((5, 5)), resolution=0.25, friction=0.1), position=(1.9, 1.1, 2.0))
        terrain.put("deck", deck)
        node.world.track("1 ball", 0.2, BodyState((1.3, 0.6, 1.0)))
        output, _ = node.node._outputs._of_entries["ground_map"]
        assert output.publisher.topic_name.endswith("/ground_map/_1_ball")
        found: list[tuple[float, Any]] = []
        with monkeypatch.context() as without_subscribers:
            without_subscribers.setattr(scan_outputs, "ground_layers", None)
            node.run(10)
        keep = SimpleNamespace(
            publish=lambda message: found.append((node.world.time, message)), get_subscription_count=lambda: 1
        )
        monkeypatch.setattr(output, "publisher", keep)
        node.run(72)
        assert len(found) in (3, 4)
        time, message = found[-1]
        truth = node.world.ground.at
        assert message.header.frame_id == "map"
        vectors = [f"{what}_{axis}" for what in ("velocity", "normal") for axis in "xyz"]
        assert [*message.layers] == ["elevation", *vectors, "friction", "sinkage", "age"]
        assert (message.info.length_x, message.info.length_y, message.info.resolution) == (*SIZE, SPACING)
        middle = message.info.pose.position
        assert max(abs(middle.x - 1.3), abs(middle.y - 0.6)) <= SPACING
        rows, columns = 12, 8  # along -x, along -y; a column is contiguous
        assert [(dim.label, dim.size, dim.stride) for dim in message.data[0].layout.dim] == [
            ("column_index", columns, rows * columns), ("row_index", rows, rows)
        ]  # fmt: skip
        for row in range(rows):
            for column in range(columns):
                x = middle.x + 0.5 * SIZE[0] - (row + 0.5) * SPACING
                y = middle.y + 0.5 * SIZE[1] - (column + 0.5) * SPACING
                cell = [layer.data[column * rows + row] for layer in message.data]
                at = truth([[x, y]], time)
                known = [*at.z, *at.velocities[0], *at.normals[0], *at.friction, 0.0 * at.z[0], *at.ages]
                np.testing.assert_allclose(cell, known, rtol=1e-5, atol=1e-6)
        first = [layer.data[0] for layer in message.data]  # farthest along +x and +y: on the deck
        assert first[0] == 2.0
        assert first[7] == pytest.approx(0.1)
        assert sum(map(math.isnan, message.data[0].data)) > 0
        raster = grid_map_raster(message, RasterConfig())
        places = raster.geometry.to_world(*np.mgrid[:columns, :rows])
        np.testing.assert_allclose(
            raster.heights, truth(places.reshape(-1, 2), time).z.reshape(columns, rows), atol=1e-6
        )


def test_sinkage_is_how_deep_soil_was_pressed() -> None:
    with World(HeightMap(np.zeros((41, 41)), resolution=0.05, origin=(-1.0, -1.0))) as world:
        world.ground.set_soil(Soil(world.terrain, "dry_sand"))
        world.terrain.put(
            "deck", Deck(HeightMap(np.zeros((3, 3)), resolution=0.2), thickness=0.1, position=(0.1, 0.1, 0.5))
        )
        world.spawn("box", Box(0.4, 0.4, 0.2), 60.0, BodyState((0.0, 0.0, 0.1)))
        world.step(240)
        grid = scan_outputs.grid_around((0.0, 0.0, 0.0), (1.0, 1.0), 0.05)
        layers = scan_outputs.ground_layers(world, grid)
        on_deck = layers["elevation"] > 0.4
        assert on_deck.sum() > 10
        assert layers["sinkage"].max() > 0.002
        np.testing.assert_allclose(layers["sinkage"], np.where(on_deck, 0.0, -layers["elevation"]), atol=1e-6)


LEVEL = np.zeros((6, 8), np.float32)


def test_what_keeps_a_mapper_from_a_score_is_told(domain: int) -> None:
    with made_with(TerrainScore, {}) as node:
        take = {it.topic_name.rpartition("/")[2]: it.callback for it in node.subscriptions if it.raw}

        def give(topic: str, sec: int, middle: tuple[float, float, float] = (0.0, 0.0, 0.0), **fields: Any) -> None:
            layers = fields.pop("layers", {"elevation": LEVEL})
            message = grid_map_message(layers, 0.1, middle, stamp=Time(sec=sec), **fields)
            take[topic](serialize_message(message))

        def words() -> str:
            level, found = node._state()
            assert (level == DiagnosticStatus.OK) == found.startswith("rmse"), found
            return found

        assert words() == "no truth on /terrain_score/truth so far; publish it, or remap ~/truth"
        give("map", 5)
        give("truth", 5)
        assert "no true map yet" in words()
        give("map", 5, frame_id="odom")
        assert "maps are in frame 'odom', the truth in 'map'; no transform is applied" in words()
        give("map", 0)
        assert "a map has no stamp" in words()
        give("map", 9)
        assert "a map is 4 s ahead of the newest true map; let one clock stamp both" in words()
        give("map", 1)
        assert "a map is 4 s older than the oldest true map" in words()
        give("map", 5, layers={"height": LEVEL})
        assert "there is no layer 'elevation'; raster.layer may be one of height" in words()
        take["map"](b"no map")
        assert "b'" not in words()
        give("map", 6)
        assert words() == "the maps wait for the truth of their time"
        give("truth", 6)
        assert words() == "rmse 0.0000 m, bias +0.0000 m, covers 100%, lag unknown, delay -1.000 s"
        give("map", 6, (30.0, 0.0, 0.0))
        assert "no ground in common" in words()
        node._came["~/map"] -= 7.0
        assert words().startswith("the mapper is silent: no map on /terrain_score/map for 7.0 s")


class Averaging:
    """A mapper of this test: the mean of the points of the newest cloud in cells of 0.25 m. Its maps are stamped
    ``late`` [s] after their clouds, and ``bias`` [m] too high."""

    def __init__(self, probe: Probe, late: float, bias: float) -> None:
        self._probe, self._late, self._bias = probe, late, bias
        self._maps = probe.node.create_publisher(GridMap, "/shared/elevation_map", 10)

    def take(self, cloud: PointCloud2) -> None:
        points = np.frombuffer(cloud.data, np.float32).reshape(-1, 3)
        columns, rows = np.floor((points[:, :2] + 4.0) / 0.25).astype(int).T
        inside = (rows >= 0) & (rows < 32) & (columns >= 0) & (columns < 32)
        flat = 32 * rows[inside] + columns[inside]
        with np.errstate(invalid="ignore"):
            means = np.bincount(flat, points[inside, 2], 1024) / np.bincount(flat, minlength=1024)
        stamp = seconds(cloud.header.stamp) + self._late
        message = grid_map_message(
            {"elevation": means.reshape(32, 32) + self._bias}, 0.25, frame_id=cloud.header.frame_id,
            stamp=Time(sec=int(stamp), nanosec=int(stamp % 1.0 * 1e9)),
        )  # fmt: skip
        self._maps.publish(message)


SHARED = {"ground_maps": ["{body: post, size: [6, 6], spacing: 0.25, rate: 50}"]}


def test_a_mapper_that_sees_the_simulated_ground_gets_its_score(shared: Probe, tmp_path: Path) -> None:
    """On ground that heaves by 0.5 m in 4 s, whose maps, clouds and true maps come in real time."""
    mapper, file = Averaging(shared, 0.2, 0.03), tmp_path / "score.csv"
    clouds = shared.listen("/shared/terrain_sensor/points", PointCloud2)
    diagnostics = shared.listen("/diagnostics", DiagnosticArray)
    remapped = ["--ros-args", "-r", "~/map:=elevation_map", "-r", "~/truth:=terrain_collider/ground_map/post", "--"]
    sensor = {"position": [0.0, 0.0, 2.5], "lidar.fan": [-1.4, -0.4], "rate": 20.0}
    with (
        shared.running("terrain_source", {"scene": "heave"}),
        shared.running("terrain_sensor", sensor),
        shared.running("terrain_score", {"csv": str(file), "longest_lag": 1.0}, remapped),
    ):

        def lag() -> float:
            shared.publish_bodies({"post": (0.0, 0.0, 2.0)}, radius=0.1)
            while clouds:
                mapper.take(clouds.pop(0))
            told = [status for each in diagnostics for status in each.status if "terrain_score: score" in status.name]
            return float(
                next((pair.value for status in told[-1:] for pair in status.values if pair.key == "lag"), "nan")
            )

        shared.wait_for(lambda: lag() == pytest.approx(0.2, abs=0.02))
    with file.open() as lines:
        score = {name: float(value) for name, value in [*csv.DictReader(lines)][-1].items()}
    assert score["spread"] < 0.03
    assert score["covered"] > 0.5
    assert abs(score["bias"]) < 0.03 + 0.2 * 0.4 + 0.02  # the ground moves at up to 0.4 m/s
