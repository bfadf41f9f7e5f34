"""What RViz draws of ``~/scene``, ``~/robot_model`` and ``~/patches``: the ground around the bodies, the bodies, the
first robot; by namespace and id until a marker deletes it, across ends and starts of a node."""

import os
import signal
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from shape_msgs.msg import SolidPrimitive
from smartmesh_msgs.msg import TrackedBody
from smartmesh_msgs.srv import RemoveBodies
from visualization_msgs.msg import Marker, MarkerArray

from smartmesh_ros import BodyState, HeightMap, Terrain
from smartmesh_ros.node.outputs.ground_view import CELLS, LOWER, ground_points, window_around
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process, points_of
from tests.bodies import rotation
from tests.ground.test_shown_patches import balls_on
from tests.node.shared import on_level, show_map, spawn
from tests.terrain.surfaces import highest
from tests.urdfs import HUSKY, ROVER, link, robot

# A busy machine reads so many messages of the node in time, too: answers wait behind them.
SHARED = {"publish.patches": 10.0, "publish.body_states": 10.0}
RESOLUTION, LOW = 0.25, -10.0
# Level in the south, where the robots stand: their wheels are free.
HEIGHTS = 0.3 * np.sin(np.maximum(np.arange(81.0) * RESOLUTION, 9.0))[:, None] + np.zeros(81)
SOLIDS = {
    "ball": (SolidPrimitive.SPHERE, [0.2]), "crate": (SolidPrimitive.BOX, [0.6, 0.4, 0.3]),
    "barrel": (SolidPrimitive.CYLINDER, [0.8, 0.25]), "pill": (TrackedBody.SHAPE_CAPSULE, [0.5, 0.15]),
}  # fmt: skip


class Display:
    """Markers as RViz keeps them. ``by_namespace``: a DELETEALL with a namespace deletes that namespace, as in new
    versions of RViz; in old ones all. ``without_ground``: newest messages without any."""

    def __init__(self, probe: Probe, topic: str, *, by_namespace: bool = False) -> None:
        self.shown: dict[tuple[str, int], Marker] = {}
        self.without_ground = 0
        self._by_namespace = by_namespace
        probe.node.create_subscription(MarkerArray, topic, self._take, 100)

    def _take(self, message: MarkerArray) -> None:
        keys = [(marker.ns, marker.id) for marker in message.markers]
        assert len(set(keys)) == len(keys), "RViz reports an id that comes twice in one array"
        self.without_ground = 0 if any(ns.rpartition("/")[2] == "ground" for ns, _ in keys) else self.without_ground + 1
        for key, marker in zip(keys, message.markers, strict=True):
            if marker.action == Marker.DELETEALL:
                kept = {ns for ns, _ in self.shown} - {marker.ns} if self._by_namespace and marker.ns else set()
                self.shown = {key: marker for key, marker in self.shown.items() if key[0] in kept}
            elif marker.action == Marker.DELETE:
                self.shown.pop(key, None)
            else:
                self.shown[key] = marker

    def of(self, what: str) -> list[Marker]:
        """Return the markers of the ground, or of the bodies, in the namespace of the node."""
        return [marker for (own, _), marker in self.shown.items() if own.rpartition("/")[2] == what]


def triangles(points: np.ndarray) -> np.ndarray:
    """Corners (T, 3, 3) of the triangles with an area, of the corners (n, 3) of all."""
    corners = points.reshape(-1, 3, 3)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return corners[np.linalg.norm(np.cross(first, second), axis=1) > 1e-9]


def outline(markers: list[Marker]) -> tuple[float, ...]:
    """Bounds of some markers along the axes that they are turned by [m], from their types and scales."""
    lows, highs = [], []
    for marker in markers:
        q, p, s = marker.pose.orientation, marker.pose.position, marker.scale
        turn = rotation(np.array([q.x, q.y, q.z, q.w]))
        middle = turn.T @ (p.x, p.y, p.z)
        half = 0.5 * np.array([s.x, s.y, s.z])
        lows.append(middle - half), highs.append(middle + half)
    return tuple((np.max(highs, axis=0) - np.min(lows, axis=0)).tolist())


def test_rviz_shows_the_ground_and_the_bodies_and_forgets_them(shared: Probe) -> None:
    show_map(shared, HEIGHTS, resolution=RESOLUTION, origin=(LOW, LOW, 0.0))
    for place, (name, (kind, dimensions)) in enumerate(SOLIDS.items()):
        shape = SolidPrimitive(type=kind, dimensions=dimensions)
        spawn(shared, name, (1.5 * place - 3.0, 1.0, 0.0), shape=shape, on_ground=True)
    for place, name in enumerate(("first", "second")):
        spawn(shared, name, (3.0 * place - 2.0, -3.0, 0.0), urdf=Path(ROVER).read_text(), on_ground=True)
    display = Display(shared, shared.topic("scene"))

    def drawn() -> bool:
        shared.publish_bodies({"guide": (4.0, 0.0, 1.0)}, radius=0.7)
        return len(display.of("bodies")) == 4 + 2 + 1 + 1 and bool(display.of("ground"))

    shared.wait_for(drawn)
    states = {body.id: body for body in shared.latest("body_states").bodies}
    by_place = {name: [] for name in states}
    for marker in display.of("bodies"):
        assert marker.header.frame_id == "map" and marker.frame_locked
        for name, place in ((name, body.pose.position) for name, body in states.items()):
            if np.hypot(marker.pose.position.x - place.x, marker.pose.position.y - place.y) < 0.5:
                by_place[name].append(marker)
    kinds = {name: sorted(marker.type for marker in found) for name, found in by_place.items()}
    assert kinds == {
        "ball": [Marker.SPHERE], "crate": [Marker.CUBE], "barrel": [Marker.CYLINDER],
        "pill": [Marker.SPHERE, Marker.SPHERE, Marker.CYLINDER], "first": [], "second": [Marker.CUBE],
    }  # fmt: skip
    edges = {"ball": (0.4, 0.4, 0.4), "crate": (0.6, 0.4, 0.3), "barrel": (0.5, 0.5, 0.8), "pill": (0.3, 0.3, 0.8)}
    for name, wanted in edges.items():
        assert outline(by_place[name]) == pytest.approx(wanted, abs=1e-3), name
    [ground] = display.of("ground")
    corners = triangles(points_of(ground))
    true = HeightMap(HEIGHTS, resolution=RESOLUTION, origin=(LOW, LOW)).at(corners[..., :2].reshape(-1, 2), 0.0).heights
    np.testing.assert_allclose(corners[..., 2].ravel(), true - 0.01, atol=1e-6)
    places = [(body.pose.position.x, body.pose.position.y) for body in states.values()]
    assert (corners[..., :2].min(axis=(0, 1)) < places).all() and (places < corners[..., :2].max(axis=(0, 1))).all()
    assert shared.call("remove_bodies", RemoveBodies, ids=["pill", "ball"]).success
    shared.wait_for(lambda: len(display.of("bodies")) == 3)  # the guide goes, too: nobody sends its pose
    shared.wait_for(lambda: display.without_ground > 15)  # it is at rest, and nobody is new any more


def test_the_ground_is_drawn_under_the_first_robot_too() -> None:
    """Its own display draws the robot, but no ground."""
    ball = "{id: ball, shape: sphere, size: [0.2], mass: 1, xy: [9, 9]}"
    with on_level({"bodies.spawn": [f"{{id: rover, urdf: {ROVER}, xy: [1, 1]}}", ball]}, keep=["scene"]) as run:
        run.run(1.0)
        grounds = [marker for scene in run.received("scene") for marker in scene.markers if marker.ns == "ground"]
        low, high = (end(points_of(grounds[-1])[:, :2], axis=0) for end in (np.min, np.max))
        for body in ("rover", "ball"):
            place = run.world.state(body).position[:2]
            assert (low <= place).all() and (place <= high).all(), body


def test_a_robot_model_has_the_frames_and_the_files_of_the_robot(tmp_path: Path) -> None:
    """It is empty for a robot whose file is no URDF any more, and without a robot."""
    edited = tmp_path / "edited.urdf"
    edited.write_text(robot(link("base")))
    spawned = f"{{id: husky, urdf: {HUSKY}, xy: [2, 2]}}"
    parameters = {"bodies.spawn": [spawned], "publish.tf": 50.0, "publish.robot_prefix": True}
    with on_level(parameters, keep=["robot_model", "/tf"]) as run:
        run.run(2.0)
        husky = ElementTree.fromstring(run.received("robot_model")[-1].data)
        links = {str(found.get("name")) for found in husky.findall("link")}
        assert all(name.startswith("husky/") for name in links)
        assert {end.get("link") for end in (*husky.iter("parent"), *husky.iter("child"))} - {None} <= links
        assert links <= {transform.child_frame_id for transform in run.received("/tf")[-1].transforms}
        meshes = [str(mesh.get("filename")) for mesh in husky.iter("mesh")]
        assert meshes and all(mesh.startswith("file:///") and Path(mesh[7:]).is_file() for mesh in meshes)
        assert sum(found.find("visual") is not None for found in husky.findall("link")) >= 5
        run.world.spawn_robot("edited", edited, BodyState((5.0, 5.0, 0.5)))
        edited.write_text("<robot")
        for name, until in (("husky", 2.5), ("edited", 3.0)):
            assert run.call("remove_bodies", RemoveBodies.Request(ids=[name])).success
            run.run(until)
            assert run.received("robot_model")[-1].data == ""


NOWHERE = np.empty((0, 3))


@pytest.mark.parametrize(
    ("positions", "low", "high"),
    [
        ([], (-10.0, -10.0), (10.0, 10.0)),
        ([(0.0, 0.0)], (-3.0, -3.0), (3.0, 3.0)),
        ([(0.0, 0.0), (8.0, 2.0)], (-3.0, -3.0), (10.0, 5.0)),
        ([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (9e5, 0.0)], (-3.0, -3.0), (4.0, 3.0)),
        ([(500.0, 500.0)], (9.0, 9.0), (10.0, 10.0)),
        ([(-9.0, 0.0), (99.0, 0.0)], (-10.0, -3.0), (-6.0, 3.0)),
    ],
)
@pytest.mark.parametrize("kind", ["map", "turned", "mesh"])
def test_the_window_covers_the_ground_around_the_bodies(kind: str, positions: Any, low: Any, high: Any) -> None:
    geometry = {"turned": {"origin": (-10.0, 10.0), "yaw": -0.5 * np.pi}}.get(kind, {"origin": (-10.0, -10.0)})
    terrain = Terrain(HeightMap(np.zeros((81, 81)), resolution=0.25, **geometry))
    if kind == "mesh":
        corners = [(x, y, 0.0) for x in (-10.0, 10.0) for y in (-10.0, 10.0)]
        terrain = Terrain(TriangleMesh(corners, [[0, 2, 3], [0, 3, 1]]))
    window = window_around(np.array(positions).reshape(-1, 2), terrain)
    assert window is not None
    size = CELLS * window.spacing
    slack = 0.51 * window.spacing
    assert window.x <= low[0] + slack and window.y <= low[1] + slack
    assert window.x + size >= high[0] - slack and window.y + size >= high[1] - slack
    assert size <= 40.0, "no wider than there is ground"
    corners = ground_points(window, terrain, 0.0, NOWHERE)
    assert len(corners) == 6 * CELLS**2
    np.testing.assert_allclose(corners[:, 2], -LOWER, atol=1e-6)
    area = 0.5 * np.linalg.norm(np.cross(*(corners[k::3] - corners[::3] for k in (1, 2))), axis=1).sum()
    assert 0.0 < area <= 400.0 + 1e-6, "triangles over ground alone"


@pytest.mark.parametrize("side", [61, 601])
def test_the_drawn_ground_hides_no_patch(side: int) -> None:
    """Where it leaves samples out, too."""
    rng = np.random.default_rng(side)
    terrain = Terrain(HeightMap(rng.normal(scale=0.2, size=(side, side)), resolution=0.1))
    places = rng.uniform(1.0, 0.1 * side - 1.0, (12, 2))
    bodies = balls_on(terrain, [0.3] * 12)
    points = bodies.at(np.column_stack([places, terrain.at(places, 0.0).heights])).points_w
    window = window_around(places, terrain)
    assert window is not None and (window.spacing > 0.15) == (side > 100)
    drawn = [triangles(ground_points(window, terrain, 0.0, known)) for known in (NOWHERE, points)]
    high = np.column_stack([points[:, :2], np.full(len(points), np.inf)])
    gaps = [points[:, 2] - highest(corners, high).values for corners in drawn]
    assert (gaps[0].min() < -0.1) == (side > 100)
    assert gaps[1].min() > LOWER - 1e-6


def test_no_ground_is_drawn_over_holes_and_without_terrain() -> None:
    assert window_around(np.zeros((1, 2)), Terrain()) is None
    heights = np.zeros((41, 41))
    heights[10:20, 10:20] = np.nan
    terrain = Terrain(HeightMap(heights, resolution=0.25))
    window = window_around(np.array([[5.0, 5.0]]), terrain)
    assert window is not None
    middles = triangles(ground_points(window, terrain, 0.0, NOWHERE)).mean(axis=1)
    assert not ((middles[:, :2] > 2.5) & (middles[:, :2] < 4.75)).all(axis=1).any()
    nothing = Terrain(HeightMap(np.full((9, 9), np.nan), resolution=0.25))
    window = window_around(np.zeros((0, 2)), nothing)
    assert window is not None and np.isfinite(ground_points(window, nothing, 0.0, NOWHERE)).all()


INCREMENTAL = {"publish.incremental": True}


def publish(probe: Probe, places: tuple[float, ...]) -> None:
    probe.publish_bodies({f"b{x}": (x, 0.0, 0.2) for x in places}, radius=0.25)
    probe.spin()


def publish_ground(probe: Probe) -> None:
    probe.publish_map(np.zeros((41, 41)), resolution=0.5, origin=(-10.0, -10.0, 0.0))


def test_markers_go_with_their_node(probe: Probe) -> None:
    patches = [Display(probe, probe.topic("patches"), by_namespace=each) for each in (True, False)]
    displays = [*patches, Display(probe, probe.topic("scene"))]

    def empty() -> bool:
        return not any(display.shown for display in displays)

    def show(*places: float) -> bool:
        publish(probe, places)
        shown = [sorted(round(marker.points[0].x + 0.5) for marker in one.shown.values()) for one in patches]
        return shown == [list(places)] * 2 and bool(displays[-1].shown)

    for places, ends in (((0.0, 2.0, 4.0), signal.SIGKILL), ((2.0,), signal.SIGTERM)):
        with probe.running(parameters=INCREMENTAL) as node:
            probe.wait_for(empty)  # what a killed node left
            publish_ground(probe)
            probe.wait_for(lambda places=places: show(*places))
            assert all(marker.frame_locked for display in displays for marker in display.shown.values())
            node.process.send_signal(ends)
            node.process.wait(TIMEOUT)
            if ends == signal.SIGKILL:
                assert all(display.shown for display in displays)
            else:
                probe.wait_for(empty)


def test_a_display_that_is_held_up_is_emptied_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The node ends while this process, which displays, is stopped for a second. (With a node that waits for half a
    second, the last message was lost in two of five runs.) Over UDP: a process that is stopped within a lock of the
    memory that Fast DDS shares may hear nothing for good."""
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")  # with LOCALHOST, shared memory is added
    with Probe() as probe, probe.running() as node:
        displays = [Display(probe, probe.topic(name)) for name in ("scene", "patches")]

        def show() -> bool:
            publish(probe, (0.0, 2.0))
            return all(display.shown for display in displays)

        publish_ground(probe)
        probe.wait_for(show)
        test, collider = os.getpid(), node.process.pid
        subprocess.Popen(f"sleep 0.2; kill -STOP {test}; kill -TERM {collider}; sleep 1; kill -CONT {test}", shell=True)
        node.process.wait(TIMEOUT)
        probe.wait_for(lambda: not any(display.shown for display in displays))


def test_nodes_that_share_a_topic_keep_each_others_patches() -> None:
    """By their namespaces, also where one starts and ends beside another that publishes only changes."""
    with Probe("one") as one, Probe("two") as two:
        display = Display(one, one.topic("patches"))

        def shown(*wanted: str) -> bool:
            for probe in (one, two):
                publish_ground(probe)
                publish(probe, (0.0,))
            return {namespace for namespace, _ in display.shown} == set(wanted)

        remapped = ["--ros-args", "-r", "__ns:=/two", "-r", f"~/patches:={one.topic('patches')}", "--"]
        with one.running(parameters=INCREMENTAL):
            one.wait_for(lambda: shown("one"))
            with Process("terrain_collider", INCREMENTAL, remapped):
                one.wait_for(lambda: shown("one", "two"))
            one.wait_for(lambda: shown("one"))
