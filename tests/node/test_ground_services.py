"""The ground as it is asked for: heights, rays, bodies on it. Over DDS: test_processes.py, test_terrain_sensor.py."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion
from smartmesh_msgs.srv import CastRays, QueryGround
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from smartmesh_ros import BodyState, Box
from smartmesh_ros.node.outputs.cdr import doubles
from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.surface_query import checked_points, ground_samples
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.testing import Probe, heightmap_message
from tests.node.shared import Fed, fed, seconds, show_map, transform_message
from tests.terrain.surfaces import first_hit, triangles_of

SIDE, RESOLUTION, LOW = 81, 0.25, -10.0
r, c = np.mgrid[:SIDE, :SIDE]
X, Y = LOW + RESOLUTION * c, LOW + RESOLUTION * r
HILLS = (0.4 * np.sin(0.6 * X) * np.cos(0.5 * Y)).astype(np.float32)
MAP: dict[str, Any] = {"heights": HILLS, "resolution": RESOLUTION, "origin": (LOW, LOW, 0.0)}
UP = [0.0, 0.0, 1.0]


def hills() -> HeightMap:
    return HeightMap(HILLS, resolution=RESOLUTION, origin=(LOW, LOW))


def publish_hills(probe: Probe) -> None:
    show_map(probe, **MAP)


@pytest.fixture
def node() -> Iterator[Fed]:
    """A node on the hills."""
    with fed({}) as made:
        made.give("heightmap", heightmap_message(**MAP))
        yield made


def query(node: Fed, points: np.ndarray, frame_id: str = "", **fields: Any) -> Any:
    given = {"header": Header(frame_id=frame_id), "x": doubles(points[:, 0]), "y": doubles(points[:, 1])}
    return node.call("query_ground", QueryGround.Request(**(given | fields)))


def cast(node: Fed, origins: Any, directions: Any, frame_id: str = "", **fields: Any) -> Any:
    given = {"header": Header(frame_id=frame_id), "range": 20.0}
    arrays = {"origins": doubles(origins), "directions": doubles(directions)}
    return node.call("cast_rays", CastRays.Request(**(given | arrays | fields)))


def array(values: Any, *shape: int) -> np.ndarray:
    return np.frombuffer(values, np.float64).reshape(-1, *shape)


def test_heights_are_those_of_the_map(node: Fed) -> None:
    points = np.random.default_rng(0).uniform(LOW - 1.0, -LOW + 1.0, (12_000, 2))  # more than one turn
    answer = query(node, points)
    assert answer.success, answer.message
    expected = ground_samples(Terrain(hills()), checked_points(points), 0.0)
    np.testing.assert_allclose(array(answer.z), expected.z, atol=1e-6)
    np.testing.assert_allclose(array(answer.normals, 3), expected.normals, atol=1e-6)
    there = ~np.isnan(expected.z)
    assert not array(answer.velocities, 3)[there].any()
    assert (array(answer.ages)[there] > 0.0).all() and np.isnan(array(answer.ages)[~there]).all()
    assert answer.header.frame_id == "map" and answer.header.stamp.sec > 0
    assert math.isnan(query(node, points[there][:1], below=[-5.0]).z[0])


@pytest.mark.parametrize("stamped", [True, False])
def test_waves_are_answered_for_the_instant_of_the_stamp(now: list[float], stamped: bool) -> None:
    """Whole maps that rise at a constant speed, each with its stamp: heights are linear in the answer's stamp."""
    speed = 0.7
    with fed({}) as node:

        def rise() -> None:
            heights = np.full((5, 5), speed * (now[0] - 1000.0))
            message = heightmap_message(heights, resolution=2.0, origin=(-4.0, -4.0, 0.0), stamp=stamp_of(now[0]))
            node.give("heightmap", message, steps=0)

        node.play(now, 1.0, 0.05, rise)
        stamp = stamp_of(now[0]) if stamped else Time()
        answer = node.call("query_ground", QueryGround.Request(header=Header(stamp=stamp), x=[0.3], y=[-0.2]))
        assert answer.success, answer.message
        assert not stamped or answer.header.stamp == stamp
        assert answer.velocities[2] == pytest.approx(speed, rel=0.01)
        # Maps are placed in simulated time to within a step.
        assert answer.z[0] == pytest.approx(speed * (seconds(answer.header.stamp) - 1000.0), abs=2.0 * speed / 240.0)
        # A paused node answers for the time at which it stands.
        node.node.pacer.pause(True)

        def height() -> float:
            now[0] += 0.1
            return float(node.call("query_ground", QueryGround.Request(x=[0.3], y=[-0.2])).z[0])

        stands = height()
        assert height() == stands
        ray = CastRays.Request(origins=[0.3, -0.2, 50.0], directions=[0.0, 0.0, -1.0], range=100.0)
        assert node.call("cast_rays", ray).distances[0] == pytest.approx(50.0 - stands, abs=1e-6)
        node.step(2)
        assert height() > stands


def test_rays_meet_hills_and_bodies(node: Fed) -> None:
    """Any ground and any bodies: tests/terrain/test_queries.py, tests/world/test_body_rays.py."""
    node.world.spawn("box", Box(0.8, 0.8, 0.5), 1.0, BodyState(), on_ground=True, align=True)
    origins, directions = [[0.0, 0.0, 5.0], [3.0, -2.0, 5.0], [0.0, 0.0, 5.0]], [[0.0, 0.0, -2.0]] * 2 + [UP]
    answer = cast(node, origins * 1000, directions * 1000)  # more than one turn
    assert answer.success, answer.message
    assert list(answer.hits) == ["box", "ground", ""] * 1000
    _, way, nothing = answer.distances[-3:]
    assert 5.0 - way == pytest.approx(hills().at([[3.0, -2.0]], 0.0).heights[0], abs=1e-6) and nothing == math.inf
    for through, hit in (([], "box"), (["box"], "ground")):
        assert list(cast(node, [0.0, 0.0, 5.0], [0.0, 0.0, -2.0], through=through).hits) == [hit]


def test_questions_in_other_frames(node: Fed) -> None:
    place = (2.0, -1.0, 0.5)
    assert "the node has just subscribed to /tf, so ask again" in query(node, np.zeros((1, 2)), "level").message
    frames = [transform_message(node, "map", name, place, 0.8) for name in ("level", "tilted")]
    frames[1].transform.rotation = Quaternion(x=math.sin(0.2), w=math.cos(0.2))
    node.give("/tf_static", TFMessage(transforms=frames))
    points = np.random.default_rng(2).uniform(-4.0, 4.0, (50, 2))
    answer = query(node, points, "level")
    assert answer.success, answer.message
    rotation = np.array([[math.cos(0.8), -math.sin(0.8)], [math.sin(0.8), math.cos(0.8)]])
    expected = ground_samples(Terrain(hills()), checked_points(points @ rotation.T + place[:2]), 0.0)
    np.testing.assert_allclose(array(answer.z), expected.z - 0.5, atol=1e-6)
    np.testing.assert_allclose(array(answer.normals, 3)[:, :2], expected.normals[:, :2] @ rotation, atol=1e-6)
    assert answer.header.frame_id == "level"
    assert "tilted by 22.9 degrees" in query(node, points, "tilted").message
    ray = cast(node, [0.0, 0.0, 0.0], [0.0, 0.0, -1.0], frame_id="tilted")
    way = (0.0, math.sin(0.4), -math.cos(0.4))
    met = first_hit(triangles_of(hills(), 0.0), np.array([place]), np.array([way]), 20.0)
    np.testing.assert_allclose(array(ray.distances), met.values, atol=1e-6)


def test_what_cannot_be_answered_is_refused_by_reason(node: Fed) -> None:
    one, stamp = np.zeros((1, 2)), node.now()
    stamp.sec -= 100
    with fed({}) as empty:
        assert "no terrain yet" in query(empty, one).message
    refused = [
        (query(node, np.zeros((100_001, 2))), "100001 points in one call; at most 100000"),
        (query(node, one, y=doubles([0.0, 1.0])), "1 x, 2 y and 0 below"),
        (query(node, one, "rover"), "no body is called 'rover' (there are no bodies), and as a frame: there is no"),
        (query(node, one, header=Header(stamp=stamp)), "before this node's time"),
        (cast(node, [0.0, 0.0], UP), "three of each"),
        (cast(node, [0.0, 0.0, math.nan], UP), "not finite"),
        (cast(node, [0.0] * 3, UP, through=["nobody"]), "no body 'nobody'"),
        (cast(node, np.zeros(300_003), np.ones(300_003)), "100001 rays"),
    ]
    for answer, words in refused:
        assert not answer.success and words in answer.message, answer.message
    assert query(node, one).success and query(node, np.zeros((0, 2))).success
    counts = node.node.refusals.counts
    assert counts["query_ground: stamp"] == counts["cast_rays: length"] == 1
