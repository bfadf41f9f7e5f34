"""Ground that no message told, such as that of a file: a view shows what the node draws of it."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import rclpy
from rclpy.serialization import serialize_message

from smartmesh_ros.tools.client.drawn_ground import drawn_ground
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.testing import COLLIDER, Probe, Process, points_of
from tests.node.shared import on_level

BODIES = [
    "{id: ball, shape: sphere, size: [0.2], xyz: [2, 2, 1]}",
    "{id: pill, shape: capsule, size: [1, 0.2], xyz: [5, 5, 1]}",
]
# How far below the true ground the node draws it [m].
LOWER = 0.01


def test_the_ground_is_read_from_between_all_other_markers() -> None:
    run = on_level({"bodies.spawn": BODIES}, keep=("scene",))
    run.run(1.0)
    for scene in run.received("scene"):
        [ground] = [marker for marker in scene.markers if marker.points]
        assert np.array_equal(drawn_ground(serialize_message(scene)), points_of(ground))
        scene.markers = [marker for marker in scene.markers if not marker.points]
        assert drawn_ground(serialize_message(scene)) is None


def test_the_ground_of_a_file_is_shown_and_clicked_until_a_map_comes(probe: Probe, tmp_path: Path) -> None:
    np.save(tmp_path / "slope.npy", np.tile(0.2 * np.linspace(0.0, 10.0, 51, dtype=np.float32), (51, 1)))
    parameters = {"terrain.file": str(tmp_path / "slope.npy"), "raster.resolution": 0.2}
    points = np.random.default_rng(7).uniform(1.0, 9.0, (100, 2))
    rclpy.init()
    with closing(Remote(COLLIDER)) as remote, Process("terrain_collider", parameters) as process:

        def shown() -> bool:
            remote.watch({"scene"})
            remote.spin(0.02)
            remote.apply_waiting()
            return bool(remote.ground.shown)

        probe.wait_for(shown, watch=process)
        heights = remote.ground.heights(points)
        assert heights == pytest.approx(0.2 * points[:, 0] - LOWER, abs=1e-6)
        above = np.column_stack([points, np.full(100, 5.0)])
        distances = remote.ground.distances(above, np.tile([0.0, 0.0, -1.0], (100, 1)))
        assert distances == pytest.approx(5.0 - heights, abs=1e-5)
        probe.wait_for(lambda: probe.connected() and shown(), watch=process)
        probe.publish_map(np.full((101, 101), 3.0))
        probe.wait_for(lambda: shown() and (remote.ground.heights(points) == 3.0).all(), watch=process)
        probe.wait_for(lambda: shown() and not probe.node.count_subscribers(probe.topic("scene")), watch=process)
    rclpy.try_shutdown()
