"""Height scans: of robots, simulated and tracked bodies, at their rate in simulated time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightScan, Sphere, Terrain
from smartmesh_ros.terrain.height_scan import yaws_of
from smartmesh_ros.tools.replay.replay import Replay
from smartmesh_ros.tools.testing import heightmap_message
from smartmesh_ros.tools.testing.replaying import replayed
from smartmesh_ros.world.height_scanner import HeightScanner
from tests import urdfs
from tests.node.test_ground_services import HILLS, LOW, RESOLUTION, hills

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


def on_hills(parameters: dict[str, Any], *topics: str) -> Replay:
    """A run on hills, of which these height scans have a subscriber."""
    ground = heightmap_message(HILLS, resolution=RESOLUTION, origin=(LOW, LOW, 0.0))
    keep = [f"height_scan/{topic}" for topic in topics]
    return replayed([("heightmap", 0.0, ground)], {**parameters, "terrain.motion": "hold"}, keep=keep)


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
