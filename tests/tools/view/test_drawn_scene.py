"""Ground that no message told, such as that of a file, and bodies of topics that a view does not know: as the node
draws them."""

import math
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message
from visualization_msgs.msg import Marker

from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.client.sight import Sight, drawn_scene
from smartmesh_ros.tools.testing import Probe, Process, heightmap_message, points_of, pose_message
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
        assert np.array_equal(drawn_scene(serialize_message(scene))[0], points_of(ground))
        scene.markers = [marker for marker in scene.markers if marker.action == Marker.ADD and not marker.points]
        assert drawn_scene(serialize_message(scene)) == (None, [])


def test_ground_that_is_gone_is_shown_no_more() -> None:
    run, ground = on_level(keep=("scene",)), Ground()
    for is_there in (True, False):
        run.run(run.time + 0.5)
        corners, _ = drawn_scene(serialize_message(run.received("scene")[-1]))
        ground.draw(corners)
        assert bool(ground.shown) == is_there
        run.give("heightmap", heightmap_message(np.zeros((0, 0))))
    ground.draw(np.eye(4, 3))
    assert len(ground.shown[""].triangles) == 1, "a point more than those of a triangle"


def test_tracked_bodies_are_where_the_node_has_them_whatever_their_topics_frames_and_shapes() -> None:
    shapes = {"can": "cylinder, size: [1, 0.2]", "bean": "capsule, size: [1, 0.2]", "orb": "sphere, size: [0.2]"}
    shapes |= {"twin": shapes["bean"], "crate": "box, size: [1, 0.5, 0.2]"}
    entries = [f"{{body: {name}, shape: {shape}}}" for name, shape in shapes.items()]
    sources = [f"{name}=/{name}" for name in shapes]
    places = {name: (1.0 + k, 2.0, 1.0) for k, name in enumerate(shapes)}
    poses = {name: PoseStamped(pose=pose_message(place, yaw=0.3)) for name, place in places.items()}
    parameters = {"bodies.spawn": BODIES, "bodies.poses": sources, "bodies.shapes": entries, "bodies.timeout": 60.0}
    given = [(f"/{name}", 0.5, pose) for name, pose in poses.items()]
    run = on_level(parameters, *given, keep=("scene", "body_descriptions"))
    run.run(1.0)
    sight = Sight()
    sight.take("body_descriptions", serialize_message(run.received("body_descriptions")[-1]))
    assert sight.has_unheard
    sight.take_tracked(drawn_scene(serialize_message(run.received("scene")[-1]))[1])
    assert sight.poses.keys() == places.keys()
    for name, place in places.items():
        assert sight.poses[name].position == pytest.approx(place)
        assert sight.poses[name].wxyz == pytest.approx([math.cos(0.15), 0.0, 0.0, math.sin(0.15)])


def test_ground_of_a_file_is_shown_until_a_map_comes_and_bodies_of_any_topic(
    remote: Remote, probe: Probe, tmp_path: Path
) -> None:
    np.save(tmp_path / "slope.npy", np.tile(0.2 * np.linspace(0.0, 10.0, 51, dtype=np.float32), (51, 1)))
    parameters = {"terrain.file": str(tmp_path / "slope.npy"), "raster.resolution": 0.2, "bodies.poses": ["tip=/tip"]}
    points = np.random.default_rng(7).uniform(1.0, 9.0, (100, 2))
    with Process("terrain_collider", parameters) as process:

        def shown() -> bool:
            remote.watch({"scene", "body_descriptions"})
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
        tip = probe.publisher(PoseStamped, "/tip")

        def placed() -> bool:
            tip.publish(PoseStamped(pose=pose_message((1.0, 2.0, 4.0))))
            return shown() and "tip" in remote.sight.poses

        probe.wait_for(placed, watch=process)
        assert remote.sight.poses["tip"].position == (1.0, 2.0, 4.0)
