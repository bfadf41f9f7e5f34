"""Height scans: of robots, simulated and tracked bodies, at their rate in simulated time."""

from __future__ import annotations

import math
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from std_msgs.msg import Float32MultiArray

from smartmesh_ros import BodyState, Box, HeightScan, Sphere, Terrain
from smartmesh_ros.node.terrain_collider import TerrainCollider
from smartmesh_ros.terrain.height_scan import yaws_of
from smartmesh_ros.world.height_scanner import HeightScanner
from tests import urdfs
from tests.node.shared import fed, made_with, wait_until
from tests.node.test_ground_services import hills

SIZE = (0.5, 0.3, 0.2)
ROBOT = urdfs.robot(urdfs.link("base", urdfs.box(SIZE), 5.0, SIZE, at="0.1 0.05 0"))
SCANS = {
    "frame_id": "map",
    "height_scans": [
        "{body: robot, layout: isaac_lab, rate: 100}",
        "{body: 2 boxes-1, layout: legged_gym}",
        "{body: seen, layout: unitree_rl_mjlab, size: [0.8, 0.4], spacing: 0.05, order: yx, values: height, scale: 1}",
        "{body: nobody}",
    ],
}


def values(message: Float32MultiArray) -> np.ndarray:
    return np.array(message.data, np.float32)


def test_scans_of_all_kinds_of_bodies_are_the_ground_around_them(domain: int) -> None:
    with fed({**SCANS, "physics.gravity": [0.0, 0.0, 0.0]}) as node:
        newest: dict[str, Any] = {}
        for output in node.node._outputs._of_entries["height_scan"]:
            keep = partial(newest.__setitem__, output.publisher.topic_name.rpartition("/")[2])
            output.publisher = SimpleNamespace(publish=keep, get_subscription_count=lambda: 1)
        world, turned = node.world, (0.0, 0.0, math.sin(0.3), math.cos(0.3))
        world.terrain.put("", hills())
        world.spawn_robot("robot", ROBOT, BodyState((2.0, 1.0, 1.0), turned))
        world.spawn("2 boxes-1", Box(0.4, 0.2, 0.2), 1.0, BodyState((-1.0, 2.0, 1.2), turned))
        world.track("seen", 0.2, BodyState((-3.0, -2.0, 0.7)))
        node.run(30)
        assert newest.keys() == {"robot", "_2_boxes_1", "seen"}
        fields: dict[str, Any] = {"size": (0.8, 0.4), "spacing": 0.05, "order": "yx", "values": "height", "scale": 1.0}
        for topic, body, axes, scan in (
            ("robot", "robot", [("y", 11, 187), ("x", 17, 17)], HeightScan.of("isaac_lab")),
            ("_2_boxes_1", "2 boxes-1", [("x", 17, 187), ("y", 11, 11)], HeightScan.of("legged_gym")),
            ("seen", "seen", [("x", 17, 17 * 9), ("y", 9, 9)], HeightScan.of("unitree_rl_mjlab", **fields)),
        ):
            message, state = newest[topic], world.base_state(body)
            assert [(axis.label, axis.size, axis.stride) for axis in message.layout.dim] == axes
            place = np.array([[*state.position, float(yaws_of([state.orientation])[0])]])
            np.testing.assert_allclose(values(message), scan.read(Terrain(hills()), place, 0.0)[0], atol=1e-5)


def test_scans_come_at_their_rate_in_simulated_time_and_only_to_subscribers(monkeypatch: pytest.MonkeyPatch) -> None:
    measured: list[float] = []
    measure = HeightScanner.measure

    def note(scanner: HeightScanner) -> None:
        measured.append(scanner._world.time)
        measure(scanner)

    monkeypatch.setattr(HeightScanner, "measure", note)
    with made_with(TerrainCollider, {"height_scans": ["{body: ball, rate: 50, delay: 0.03, values: height}"]}) as node:
        world = node.session.world
        world.terrain.put("", hills())
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 5.0), linear=(1.0, 0.5, 0.0)))
        for _ in range(20):
            node.tick()
        assert not measured
        watcher = Node("watcher", context=node.context)
        watcher.create_subscription(Float32MultiArray, f"/{node.get_name()}/height_scan/ball", lambda _: None, 10)
        [output] = node._outputs._of_entries["height_scan"]
        wait_until(output.publisher.get_subscription_count)
        published: list[tuple[float, np.ndarray]] = []
        recorder = SimpleNamespace(
            publish=lambda message: published.append((world.time, values(message))), get_subscription_count=lambda: 1
        )
        monkeypatch.setattr(output, "publisher", recorder)
        seen = {}
        for _ in range(96):
            node.tick()
            seen[world.time] = world.height_scan("ball", HeightScan.of("isaac_lab", values="height"))[0]
        assert len(measured) in (20, 21)
        np.testing.assert_allclose(np.diff(measured[1:]), 0.02, atol=world.dt)
        assert len(published) in (len(measured) - 2, len(measured) - 1)
        for (known, found), instant in zip(published, measured, strict=False):
            assert 0.03 - 1e-6 <= known - instant < 0.03 + world.dt
            np.testing.assert_allclose(found, seen[instant], atol=1e-6)
        world.reset_time()
        count = len(measured)
        for _ in range(24):
            node.tick()
        assert len(measured) - count in (5, 6)
        watcher.destroy_node()
