"""The true ground around bodies: maps of it, scores of a mapper against them, height scans at simulated rates."""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import serialize_message

from smartmesh_ros import BodyState, Box, HeightScan, Sphere, Terrain
from smartmesh_ros.node.outputs import scan_outputs
from smartmesh_ros.terrain.height_scan import yaws_of
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.score.terrain_score import TerrainScore
from smartmesh_ros.tools.testing import heightmap_message
from smartmesh_ros.world.height_scanner import HeightScanner
from tests import urdfs
from tests.grid_maps import grid_map_message
from tests.node.shared import made_with
from tests.node.test_ground_services import HILLS, MAP, hills

SIZE, SPACING = (3.0, 2.0), 0.25


def test_a_ground_map_is_the_ground_in_the_layout_of_grid_map(monkeypatch: pytest.MonkeyPatch) -> None:
    entry, topic = f"{{body: 1 ball, size: {[*SIZE]}, spacing: {SPACING}, rate: 10}}", "ground_map/_1_ball"
    heights, friction = HILLS.copy(), np.random.default_rng(0).uniform(0.2, 1.0, HILLS.shape)
    heights[40, 45] = np.nan
    maps = [
        ("heightmap", time, heightmap_message(**{**MAP, "heights": heights + rise}, friction=friction))
        for time, rise in ((0.0, 0.0), (0.1, 0.05))
    ]
    parameters, ball = {"ground_maps": [entry, "{body: nobody}"]}, BodyState((1.3, 0.6, 1.0))
    with monkeypatch.context() as without_subscribers, Replay(maps, parameters) as run:
        without_subscribers.setattr(scan_outputs, "ground_layers", None)
        run.world.track("1 ball", 0.2, ball)
        run.run(0.3)
    with Replay(maps, parameters, keep=[topic]) as run:
        run.world.track("1 ball", 0.2, ball)
        while len(run.received(topic)) < 4:
            run.run(run.time + run.world.dt)
        time, message = run.world.time, run.received(topic)[-1]
        assert time == pytest.approx(0.35, abs=0.06), "at 10 Hz"
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
        row, column = (index.ravel() for index in np.mgrid[:rows, :columns])
        x, y = middle.x + 0.5 * SIZE[0] - (row + 0.5) * SPACING, middle.y + 0.5 * SIZE[1] - (column + 0.5) * SPACING
        at = run.world.ground.at(np.column_stack([x, y]), time)
        known = np.column_stack([at.z, at.velocities, at.normals, at.friction, 0.0 * at.z, at.ages])
        cells = np.array([layer.data for layer in message.data])[:, column * rows + row]
        np.testing.assert_allclose(cells.T, known, rtol=1e-5, atol=1e-6)
        assert sum(map(math.isnan, message.data[0].data)) > 0


LEVEL = np.zeros((6, 8), np.float32)


def test_what_keeps_a_mapper_from_a_score_is_told_and_scores_are_written(tmp_path: Path) -> None:
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
        assert "there is no layer 'elevation'; layer may be one of height" in words()
        take["map"](b"no map")
        assert "b'" not in words()
        give("map", 6, frame_id="/map")
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


EDGES = (0.5, 0.3, 0.2)
ROBOT = urdfs.robot(urdfs.link("base", urdfs.box(EDGES), 5.0, EDGES, at="0.1 0.05 0"))
SCANS = {
    "frame_id": "map",
    "height_scans": [
        "{body: robot, layout: isaac_lab, rate: 100}",
        "{body: 2 boxes-1, layout: legged_gym}",
        "{body: seen, layout: unitree_rl_mjlab, size: [0.8, 0.4], spacing: 0.05, order: yx, values: height, scale: 1}",
        "{body: nobody}",
    ],
}


def on_hills(parameters: dict[str, Any], *topics: str) -> Replay:
    """A run on hills, of which these height scans have a subscriber."""
    keep = [f"height_scan/{topic}" for topic in topics]
    return Replay([("heightmap", 0.0, heightmap_message(**MAP))], {**parameters, "terrain.motion": "hold"}, keep=keep)


def test_scans_of_all_kinds_of_bodies_are_the_ground_around_them() -> None:
    topics = ("robot", "_2_boxes_1", "seen", "nobody")
    with on_hills({**SCANS, "physics.gravity": [0.0, 0.0, 0.0]}, *topics) as run:
        world, turned = run.world, (0.0, 0.0, math.sin(0.3), math.cos(0.3))
        world.spawn_robot("robot", ROBOT, BodyState((2.0, 1.0, 1.0), turned))
        world.spawn("2 boxes-1", Box(0.4, 0.2, 0.2), 1.0, BodyState((-1.0, 2.0, 1.2), turned))
        world.track("seen", 0.2, BodyState((-3.0, -2.0, 0.7)))
        run.run(0.12)
        assert not run.received("height_scan/nobody")
        fields: dict[str, Any] = {"size": (0.8, 0.4), "spacing": 0.05, "order": "yx", "values": "height", "scale": 1.0}
        for topic, body, axes, scan in (
            ("robot", "robot", [("y", 11, 187), ("x", 17, 17)], HeightScan.of("isaac_lab")),
            ("_2_boxes_1", "2 boxes-1", [("x", 17, 187), ("y", 11, 11)], HeightScan.of("legged_gym")),
            ("seen", "seen", [("x", 17, 17 * 9), ("y", 9, 9)], HeightScan.of("unitree_rl_mjlab", **fields)),
        ):
            message, state = run.received(f"height_scan/{topic}")[-1], world.base_state(body)
            assert [(axis.label, axis.size, axis.stride) for axis in message.layout.dim] == axes
            place = np.array([[*state.position, float(yaws_of([state.orientation])[0])]])
            np.testing.assert_allclose(message.data, scan.read(Terrain(hills()), place, 0.0)[0], atol=1e-5)


def test_scans_come_at_their_rate_in_simulated_time_and_only_to_subscribers(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a delayed scan shows: tests/world/test_height_scan.py."""
    measured, measure = list[float](), HeightScanner.measure

    def note(scanner: HeightScanner) -> None:
        measured.append(scanner._world.time)
        measure(scanner)

    monkeypatch.setattr(HeightScanner, "measure", note)
    scans = {"height_scans": ["{body: ball, rate: 50, delay: 0.03}"]}
    for topics in ((), ("ball",)):
        with on_hills(scans, *topics) as run:
            run.world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 5.0)))
            run.run(0.4)
            assert len(measured) in ((20, 21) if topics else (0,))
            if topics:
                np.testing.assert_allclose(np.diff(measured[1:]), 0.02, atol=run.world.dt)
                assert len(run.received("height_scan/ball")) in (len(measured) - 2, len(measured) - 1)
                run.world.reset_time()
                count = len(measured)
                run.run(0.5)
                assert len(measured) - count in (5, 6)
