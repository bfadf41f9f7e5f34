"""The simulated lidar and depth camera over real DDS."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from smartmesh_msgs.srv import CastRays, RemoveBody
from tf2_msgs.msg import TFMessage

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.outputs.cdr import doubles
from smartmesh_ros.node.sensor.terrain_sensor import SPECS, TerrainSensor, directions_of
from smartmesh_ros.tools.testing import Probe
from tests.bodies import rotation
from tests.node.shared import LATCHED, Logged, box, made_with, spawn
from tests.node.test_ground_services import hills, publish_hills

CAMERA = {"sensor": "depth_camera", "pitch": 0.6, "position": [0.1, 0.0, 1.5], "camera.columns": 40, "camera.rows": 30}
EXACT = {"noise.constant": 0.0, "noise.quadratic": 0.0}


def spawn_post(probe: Probe) -> None:
    """A heavy box at rest on a slope, which carries the sensor."""
    publish_hills(probe)
    spawn(probe, "post", (2.0, 1.0, 0.0), shape=box(0.5, 0.5, 0.4), mass=50.0, on_ground=True, align=True)


def points_of_cloud(cloud: PointCloud2) -> np.ndarray:
    assert [field.name for field in cloud.fields] == ["x", "y", "z"] and cloud.point_step == 12
    return np.frombuffer(cloud.data, np.float32).reshape(cloud.width, 3).astype(np.float64)


def in_map(probe: Probe, points: np.ndarray) -> np.ndarray:
    """Points of the post's frame in the terrain's frame."""
    pose = next(body.pose for body in probe.latest("body_states").bodies if body.id == "post")
    q, p = pose.orientation, pose.position
    return np.asarray(points @ rotation(np.array([q.x, q.y, q.z, q.w])).T + (p.x, p.y, p.z))


def errors(points: np.ndarray) -> np.ndarray:
    """Heights of points (n, 3) above the hills [m]."""
    return np.asarray(points[:, 2] - hills().at(points[:, :2], 0.0).heights)


def test_a_lidar_on_a_body_sees_the_ground_and_not_its_body(shared: Probe) -> None:
    """That its rays meet nothing is told once, and so is the end of that, but nothing of a service that was there."""
    publish_hills(shared)
    spawn(shared, "post", (2.0, 1.0, 500.0), shape=box(0.5, 0.5, 0.4))
    clouds = shared.listen("/shared/terrain_sensor/points", PointCloud2)
    parameters = {"frame": "post", "through": ["post"], "position": [0.0, 0.0, 0.0], "rate": 50.0, **EXACT}
    with shared.running("terrain_sensor", parameters) as process:
        shared.wait_for(lambda: len(clouds) > 20)
        assert all(cloud.width == 0 for cloud in clouds)
        shared.call("remove_body", RemoveBody, id="post")
        spawn_post(shared)
        shared.wait_for(lambda: "rays meet something again" in process.output)
        told = [line for line in process.output.splitlines() if "[WARN]" in line and "refused" not in line]
        assert sum("no ray meets anything within 0.5 to 15 m around frame 'post'" in line for line in told) == 1
        assert not any("there is no service" in line for line in told)
        assert clouds[-1].header.frame_id == "post"

        def on_the_hills() -> bool:
            """Once the box rests: flat rays enlarge the way that it creeps between a look and its state. The rays start
            in the box, and pass through its sides."""
            points = points_of_cloud(clouds[-1])
            assert np.linalg.norm(points, axis=1).max(initial=0.0) <= 15.0 + 1e-3
            return len(points) > 1000 and bool(np.abs(errors(in_map(shared, points))).max() < 0.02)

        shared.wait_for(on_the_hills)


def test_noise_has_the_deviation_that_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = {"noise.constant": 0.03, "noise.quadratic": 0.002, "position": [0.0, 0.0, 0.0]}
    with made_with(TerrainSensor, noise) as node:
        found: list[PointCloud2] = []
        monkeypatch.setattr(node, "_points", SimpleNamespace(publish=found.append))
        directions = np.concatenate([node.directions_b(look) for look in range(4)])
        true = np.linspace(1.0, 12.0, len(directions))
        answer = CastRays.Response(success=True, distances=doubles(true))
        node._on_answer(SimpleNamespace(result=lambda: answer), directions)
        off = np.linalg.norm(points_of_cloud(found[0]), axis=1) - true
        assert np.std(off / (0.03 + 0.002 * true**2)) == pytest.approx(1.0, rel=0.05)
        assert np.mean(off) == pytest.approx(0.0, abs=0.01)


def test_a_refusal_of_looks_is_told_although_looks_are_left_out(
    monkeypatch: pytest.MonkeyPatch, logged: Logged
) -> None:
    monkeypatch.setattr("smartmesh_ros.node.sensor.terrain_sensor.GRACE", -1.0)
    refusal = CastRays.Response(success=False, message="no body is called 'nobody'")
    with made_with(TerrainSensor, {}) as node:
        node._asked, node._asked_at = refusal, node.get_clock().now().nanoseconds * 1e-9
        node._on_time()
        node._on_answer(SimpleNamespace(result=lambda: refusal), np.zeros((0, 3)))
    said = logged()
    assert "looks take longer than 1 / rate" in said and "no look: no body is called 'nobody'" in said


def test_a_depth_camera_agrees_with_its_cloud(shared: Probe) -> None:
    spawn_post(shared)
    camera = "/shared/terrain_sensor"
    clouds, images = shared.listen(f"{camera}/points", PointCloud2), shared.listen(f"{camera}/image", Image)
    infos, frames = shared.listen(f"{camera}/camera_info", CameraInfo), shared.listen("/tf_static", TFMessage, LATCHED)
    with shared.running("terrain_sensor", {"frame": "post", **CAMERA, **EXACT}):
        shared.wait_for(lambda: frames and infos and clouds and images)
        stamp = images[-1].header.stamp
        cloud = shared.wait_for(lambda: next((one for one in clouds if one.header.stamp == stamp), None))
        image, info = images[-1], infos[-1]
        assert (image.encoding, image.width, image.height, image.header.frame_id) == (
            "32FC1", 40, 30, "shared/terrain_sensor_optical",
        )  # fmt: skip
        depths = np.frombuffer(image.data, np.float32).reshape(30, 40).astype(np.float64)
        v, u = np.nonzero(~np.isnan(depths))
        fx, fy, cx, cy = info.k[0], info.k[4], info.k[2], info.k[5]
        z = depths[v, u]
        optical = np.column_stack([(u - cx) / fx * z, (v - cy) / fy * z, z])
        transform = frames[-1].transforms[0]
        assert (transform.header.frame_id, transform.child_frame_id) == ("post", "shared/terrain_sensor_optical")
        q, t = transform.transform.rotation, transform.transform.translation
        projected = optical @ rotation(np.array([q.x, q.y, q.z, q.w])).T + (t.x, t.y, t.z)
        np.testing.assert_allclose(projected, points_of_cloud(cloud), atol=1e-4)
        assert math.isclose(fx, 19.5 / math.tan(0.5 * math.radians(87.0)), rel_tol=1e-9)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"sensor": "sonar"}, "choose one of lidar, depth_camera"),
        ({"range.nearest": 20.0}, "less than range.farthest"),
        ({"lidar.beams": 500, "lidar.steps": 1000}, "500000 rays in one look"),
        ({"position": [1.0]}, "position has 1 numbers"),
    ],
)
def test_impossible_sensors_do_not_start(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words), made_with(TerrainSensor, parameters):
        pass


def test_the_sectors_of_a_turn_are_the_turn() -> None:
    lidar = {spec.name: spec.default for spec in SPECS} | {"lidar.sectors": 4}
    whole = directions_of(lidar | {"lidar.sectors": 1}, 0)
    parts = np.concatenate([directions_of(lidar, look) for look in range(4)])
    rounded = [{tuple(ray) for ray in np.round(rays, 6).tolist()} for rays in (whole, parts)]
    assert rounded[0] == rounded[1]
    assert len(rounded[0]) == lidar["lidar.beams"] * lidar["lidar.steps"]
