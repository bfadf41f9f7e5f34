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
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import serialize_message

from smartmesh_ros import BodyState, Deck, HeightMap
from smartmesh_ros.node.outputs import scan_outputs
from smartmesh_ros.tools.score.terrain_score import TerrainScore
from tests.grid_maps import grid_map_message
from tests.node.shared import fed, made_with
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
        assert (first[0], first[7]) == (2.0, pytest.approx(0.1))
        assert sum(map(math.isnan, message.data[0].data)) > 0


LEVEL = np.zeros((6, 8), np.float32)


def test_what_keeps_a_mapper_from_a_score_is_told_and_scores_are_written(domain: int, tmp_path: Path) -> None:
    folder = tmp_path / "stick"
    folder.mkdir()
    file = folder / "score.csv"
    with made_with(TerrainScore, {"csv": str(file)}) as node:
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
        folder.rename(tmp_path / "unplugged")
        give("map", 6)
        assert words().startswith("csv cannot be written: ") and str(file) in words()
    with (tmp_path / "unplugged" / file.name).open() as lines:
        [score, _] = csv.DictReader(lines)
    assert (float(score["rmse"]), float(score["covered"]), float(score["delay"])) == (0.0, 1.0, -1.0)
