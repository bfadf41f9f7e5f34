"""What the page draws of terrain and robots, without a browser: clicks, colours of ruts and materials, decks."""

import asyncio
import io
import math
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import BodyDescription, BodyDescriptionArray, HeightmapUpdate, TrackedBody, TrackedBodyArray
from std_msgs.msg import Header

from smartmesh_ros.errors import InputError
from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.testing import TIMEOUT, Process, floats, heightmap_message, pose_message
from tests.bodies import about_z, rotation
from tests.examples import examples

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

import trimesh

from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.remote import Remote
from smartmesh_ros.tools.client.sight import KINDS, Pose, Sight
from smartmesh_ros.tools.view.camera import Lens, camera_on
from smartmesh_ros.tools.view.main import main
from smartmesh_ros.tools.view.page import Page, start_server, stop_server, url_of
from smartmesh_ros.tools.view.robots import GAP, Robot
from smartmesh_ros.tools.view.scene import Scene
from smartmesh_ros.tools.view.terrain_scene import Depth, Give, Grip, TerrainScene, triangles_by_band


@pytest.fixture
def server() -> Iterator[Any]:
    made = start_server("127.0.0.1", 0)
    yield made
    stop_server(made)


def give(ground: Ground, message: Any, topic: str = "heightmap") -> None:
    """A message, or its bytes."""
    ground.take(topic, message if isinstance(message, bytes) else serialize_message(message))
    ground.apply_waiting()


def ground_of(heights: np.ndarray, **options: object) -> Ground:
    ground = Ground()
    give(ground, heightmap_message(heights, **options))
    return ground


@given(yaw=st.floats(-3, 3), x=st.floats(-3, 3), y=st.floats(-3, 3), slope=st.floats(-1, 1))
@examples(50)
def test_a_click_meets_the_ground_that_is_seen_there(yaw: float, x: float, y: float, slope: float) -> None:
    """On a plane, which triangles and rectangles of samples represent exactly."""
    across = np.linspace(0.0, 20.0, 101)
    cos, sin = 10.0 * math.cos(yaw), 10.0 * math.sin(yaw)
    origin = (sin - cos, -sin - cos, 1.0)
    ground = ground_of(np.tile(slope * across, (101, 1)), resolution=0.2, yaw=yaw, origin=origin)
    target = np.array([x, y, ground.heights(np.array([[x, y]]))[0]])
    eye = np.array([1.0, -30.0, 60.0])
    [distance, beside] = ground.distances(np.stack([eye, eye]), np.stack([target - eye, [0.0, 0.0, 1.0]]))
    assert distance == pytest.approx(np.linalg.norm(target - eye), abs=1e-3)
    assert np.isinf(beside)


def test_a_click_meets_the_nearest_body_on_its_way() -> None:
    ball = BodyDescription(shape=BodyDescription.SPHERE, dimensions=[0.5])
    sight = Sight(
        poses={name: Pose((x, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for name, x in (("far", 8.0), ("near", 4.0))},
        appearances={"far": ball, "near": ball},
    )
    assert sight.hit(np.zeros(3), np.array([1.0, 0.0, 0.0])) == "near"
    assert sight.hit(np.zeros(3), np.array([-1.0, 0.0, 0.0])) is None
    assert sight.hit(np.array([0.0, 2.0, 0.0]), np.array([1.0, 0.0, 0.0])) is None


def test_regions_are_written_into_the_map_and_a_new_map_replaces_them() -> None:
    ground = ground_of(np.zeros((6, 8)))
    region = HeightmapUpdate(x=2, y=1, width=3, height=2, heights=floats(np.ones((2, 3), np.float32)))
    give(ground, region, "heightmap_update")
    expected = np.zeros((6, 8))
    expected[1:3, 2:5] = 1.0
    assert np.array_equal(ground.tiles[""].heights, expected)
    ground.take("heightmap_update", serialize_message(region))
    give(ground, heightmap_message(np.full((6, 8), 2.0)))
    assert (ground.tiles[""].heights == 2.0).all()
    for spoilt in (b"", b"\0\1\0\0" + bytes(40), serialize_message(region)[:-4]):
        give(ground, spoilt, "heightmap_update")
        give(ground, spoilt)
    assert (ground.tiles[""].heights == 2.0).all(), "what makes no sense changes nothing"


def test_every_triangle_that_sank_has_the_colour_of_its_deepest_corner() -> None:
    sunk = np.array([0.0, 0.0009, 0.001, 0.004, 0.005, 0.02, 0.3, -1.0, np.nan])
    triangles = np.array([*([0, 0, corner] for corner in range(len(sunk))), [6, 6, 8]])  # the last is beside a hole
    found = {depth: chosen[:, 2].tolist() for depth, chosen in triangles_by_band(sunk, triangles, Depth)}
    assert found == {Depth.SLIGHT: [2, 3], Depth.SHALLOW: [4], Depth.DEEP: [5], Depth.DEEPEST: [6]}


@pytest.mark.parametrize("topic", ["heightmap_update", "pressed_ground"])
def test_ruts_are_coloured_while_that_is_asked_for(server: Any, topic: str) -> None:
    ground = ground_of(np.full((40, 40), 3.0), resolution=0.1)
    drawn, scene = server.scene._handle_from_node_name, TerrainScene(server.scene, period=0.0)

    def colours(*, sunk: bool) -> set[str]:
        scene.show(ground, np.zeros((0, 3)), np.zeros(0), [], sunk=sunk)
        return {name.rpartition("/")[2] for name in drawn if name.startswith("/sunk/")} & {d.name for d in Depth}

    assert colours(sunk=True) == set()
    give(ground, HeightmapUpdate(x=5, y=10, width=20, height=3, heights=floats(np.full(60, 2.98))), topic)
    assert colours(sunk=True) == {"DEEP"}
    mesh = drawn["/sunk/terrain/tile_/DEEP"]
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert np.allclose([low[:2], high[:2]], [[0.4, 0.9], [2.5, 1.3]], atol=1e-5), "to the first samples beside it"
    assert colours(sunk=False) == set()
    give(ground, heightmap_message(np.full((40, 40), 3.0), resolution=0.1))
    assert colours(sunk=True) == set()


def test_ground_of_another_material_than_usual_is_coloured_where_it_lies(server: Any) -> None:
    """The ground of a map that scrolls keeps it; new ground is usual."""
    ground = ground_of(np.zeros((40, 40)), resolution=0.1)
    drawn, scene = server.scene._handle_from_node_name, TerrainScene(server.scene, period=0.0)

    def coloured(x: float = 0.0, **material: Any) -> dict[str, tuple[float, float]]:
        """Names of the colours, and from where to where along x [m]."""
        give(ground, heightmap_message(np.zeros((40, 40)), resolution=0.1, origin=(x, 0.0, 0.0), **material))
        scene.show(ground, np.zeros((0, 3)), np.zeros(0), [])
        bands = [*(("grip", band) for band in Grip), *(("give", band) for band in Give)]
        names = {band.name: drawn.get(f"/{kind}/terrain/tile_/{band.name}") for kind, band in bands}
        along = {name: mesh.vertices[:, 0] for name, mesh in names.items() if mesh is not None}
        return {name: (pytest.approx(x.min(), abs=1e-5), pytest.approx(x.max(), abs=1e-5)) for name, x in along.items()}

    friction = np.ones((40, 40))
    friction[:, :10], friction[:, 20:] = 0.1, 1.5
    assert coloured() == {}
    assert coloured(friction=1.0) == {}
    assert coloured(friction=friction) == {"ICE": (0.0, 1.0), "ROUGH": (1.9, 3.9)}
    assert coloured() == {"ICE": (0.0, 1.0), "ROUGH": (1.9, 3.9)}
    assert coloured(x=0.5) == {"ICE": (0.5, 1.0), "ROUGH": (1.9, 4.0)}
    assert coloured(x=0.5, friction=0.5) == {"SLIPPERY": (0.5, 4.4)}
    assert coloured(x=0.5, friction=np.nan) == {}
    stiffness = np.full((40, 40), np.nan)
    stiffness[:, :10] = 2e5
    assert coloured(x=0.5, layers={"stiffness": stiffness}) == {"SOFT": (0.5, 1.5)}
    assert coloured(x=0.5) == {"SOFT": (0.5, 1.5)}


def test_no_ground_is_drawn_over_a_patch_that_has_moved_since_the_map(server: Any) -> None:
    """Below it, at the same samples; the ground elsewhere stays."""
    ground = ground_of(np.random.default_rng(0).normal(scale=0.1, size=(40, 40)), resolution=0.1)
    drawn, scene = server.scene._handle_from_node_name, TerrainScene(server.scene, period=0.0)
    tile, (r, c) = ground.tiles[""], np.divmod(np.arange(49), 7)
    rows, columns = 20 + r - 3, 12 + c - 3
    places = tile.geometry.to_world(rows, columns)
    for rise in (-0.2, 0.0):
        vertices = np.column_stack([places, tile.heights[rows, columns] + rise])
        patch = Patch(
            name="ball", kind="heightfield", tile="", row=20, column=12, stride=1, deviation=0.0, linear_w=np.zeros(3),
            angular_w=np.zeros(3), vertices_w=vertices, triangles=np.zeros((0, 3), np.uint32),
        )  # fmt: skip
        scene.show(ground, np.array([[1.2, 2.0, 0.1]]), np.array([0.2]), [patch])
        mesh = drawn["/terrain/tile_"]
        found = {tuple(np.rint(10.0 * v[:2]).astype(int)): v[2] for v in np.asarray(mesh.vertices, float)}
        for k in range(49):
            assert found[(columns[k], rows[k])] == pytest.approx(vertices[k, 2], abs=1e-5)
        assert found[(16, 20)] == pytest.approx(tile.heights[20, 16], abs=1e-5)


def test_malformed_messages_are_skipped() -> None:
    """Anybody may publish on the topics of the node's inputs, and the node refuses what is malformed."""
    remote = Remote.__new__(Remote)
    remote.ground, remote.sight, remote.counts, remote._new = Ground(), Sight(), Counter(), {}
    for topic in KINDS:
        remote._new[topic] = deque([serialize_message(TrackedBodyArray(bodies=[TrackedBody(id="a")]))[:-4], b""])
    remote._take("collider_patches", b"")
    remote.apply_waiting()
    assert not remote.sight.poses and not remote.sight.patches


def test_tracked_bodies_of_another_frame_are_not_drawn_where_they_are_not() -> None:
    sight = Sight()
    for topic, frame in (("body_states", "map"), ("tracked_bodies", "odom"), ("tracked_bodies", "/map")):
        body = TrackedBody(id=f"{topic} in {frame}")
        sight.take(topic, serialize_message(TrackedBodyArray(header=Header(frame_id=frame), bodies=[body])))
    for frame, number in (("map", 2), ("odom", 3)):
        poses = [pose_message((1.0, 2.0, 3.0))] * number
        sight.take("body_poses", serialize_message(PoseArray(header=Header(frame_id=frame), poses=poses)))
    assert sight.poses.keys() == {"body_states in map", "tracked_bodies in /map", "body_0", "body_1"}
    assert sight.poses["body_1"].position == (1.0, 2.0, 3.0)


@pytest.mark.parametrize("wrong", [math.nan, -math.inf, 1e20])
@pytest.mark.parametrize("topic", ["tracked_bodies", "body_poses"])
def test_poses_that_the_node_refuses_are_not_shown(topic: str, wrong: float) -> None:
    """The camera that should show them ended the view."""
    sight, ground = Sight(), ground_of(np.zeros((9, 9)))
    for x in (1.0, wrong):
        pose = pose_message((x, 2.0, 3.0))
        poses, bodies = PoseArray(poses=[pose]), TrackedBodyArray(bodies=[TrackedBody(id="body_0", pose=pose)])
        with nullcontext() if x == 1.0 else pytest.raises(InputError):
            sight.take(topic, serialize_message(poses if topic == "body_poses" else bodies))
        assert np.isfinite(camera_on(*sight.bodies, Lens(1.0, 1.5), ground).position).all()
    assert sight.poses["body_0"].position == (1.0, 2.0, 3.0)


def test_a_body_that_was_removed_is_not_found_at_its_last_pose() -> None:
    """Also if states of before its removal are read after the descriptions: the view reads the newest of each topic."""
    sight = Sight()
    crate = BodyDescription(id="crate", tracked=True)
    tracked = TrackedBodyArray(bodies=[TrackedBody(id="crate")])
    for names in (("ball", "box"), ("ball",)):
        described = BodyDescriptionArray(bodies=[crate, *(BodyDescription(id=name) for name in names)])
        sight.take("body_descriptions", serialize_message(described))
        sight.take("tracked_bodies", serialize_message(tracked))
        before = TrackedBodyArray(bodies=[TrackedBody(id=name) for name in ("ball", "box")])
        sight.take("body_states", serialize_message(before))
    sight.take("body_states", serialize_message(TrackedBodyArray(bodies=[TrackedBody(id="ball")])))
    assert sight.poses.keys() == {"ball", "crate"}


def test_tiles_and_patches_of_a_deck_are_drawn_and_clicked_where_its_odometry_says(server: Any) -> None:
    """Also a patch of a moment ago, when the deck was elsewhere."""
    ground, sight = ground_of(np.zeros((11, 11)), resolution=1.0), Sight()
    ground.frames = sight.bases
    tile = "ferry/roof"
    give(ground, heightmap_message(np.zeros((5, 5)), resolution=0.5, origin=(-1.0, -1.0, 0.25), tile=tile))
    scene, drawn = Scene(server), server.scene._handle_from_node_name
    eye, down = np.array([[4.0, 5.0, 9.0]]), np.array([[0.0, 0.0, -1.0]])
    corners, turn = np.array([(0.0, 0.0), (0.5, 0.0), (0.0, 0.5)]), rotation(about_z(0.3))[:2, :2]
    sight.patches["box"] = Patch(
        name="box", kind="trimesh", tile=tile, row=0, column=0, stride=0, deviation=0.0, linear_w=np.zeros(3),
        angular_w=np.zeros(3), vertices_w=np.column_stack([corners @ turn.T + (4.0, 5.0), np.ones(3)]),
        triangles=np.array([[0, 1, 2]], np.uint32),
    )  # fmt: skip
    for height in (2.0, 3.0):
        place = Odometry(child_frame_id="ferry")
        place.pose.pose = pose_message((4.0, 5.0, height), yaw=0.3)
        sight.take("odometry", serialize_message(place))
        scene.show(ground, sight)
        frame, mesh = drawn["/decks/ferry"], drawn["/decks/ferry/terrain/tile_ferry%2Froof"]
        assert frame.position == pytest.approx([4.0, 5.0, height])
        assert frame.wxyz == pytest.approx([math.cos(0.15), 0.0, 0.0, math.sin(0.15)])
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        np.testing.assert_allclose([low, high], [[-1.0, -1.0, 0.25], [1.0, 1.0, 0.25]], atol=1e-5)
        patch = drawn["/decks/ferry/patches/mesh"]
        np.testing.assert_allclose(patch.vertices[:, :2], corners, atol=1e-5)
        np.testing.assert_allclose(patch.vertices[:, 2], 0.25, atol=0.01)
        assert ground.distances(eye, down) == pytest.approx(9.0 - height - 0.25)
    assert "/terrain/tile_" in drawn and "/terrain/tile_ferry%2Froof" not in drawn


def test_a_tile_is_drawn_whatever_the_names_of_others_and_stays_when_they_go(server: Any) -> None:
    ground, scene, drawn = Ground(), TerrainScene(server.scene), server.scene._handle_from_node_name
    names = ["", "map", "a", "a/b", "a%2Fb", "a/b/c"]
    for gone in ("", *names):
        for name in names:
            message = heightmap_message(np.zeros((0, 0)) if name == gone else np.zeros((5, 5)), tile=name)
            ground.take("heightmap", serialize_message(message))
        ground.apply_waiting()
        scene.show(ground, np.zeros((0, 3)), np.zeros(0), [])
        assert sum(path.startswith("/terrain/") for path in drawn) == len(names) - 1
        assert scene._reliefs.keys() == ground.first.keys() == ground.tiles.keys(), "nothing is kept of what is gone"


URDF = '<robot name="r"><link name="b"><visual><geometry><box size="1 1 0.4"/></geometry></visual></link></robot>'


@pytest.mark.parametrize("mesh", ["box.stl", "missing.stl", "package://nowhere/missing.stl"])
def test_a_robot_is_drawn_by_its_meshes_and_else_by_its_collision_shapes(
    server: Any, tmp_path: Path, mesh: str
) -> None:
    trimesh.creation.box((1.0, 1.0, 0.8)).export(tmp_path / "box.stl")
    urdf = (
        f'<robot name="r"><link name="b"><visual><geometry><mesh filename="{mesh}"/></geometry></visual>'
        '<collision><geometry><box size="1 1 0.4"/></geometry></collision></link></robot>'
    )
    robot = Robot(server, "rover", BodyDescription(urdf=urdf, urdf_file=str(tmp_path / "robot.urdf")))
    robot.show(Sight(bases={"b": Pose((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))}))
    assert not robot.fault
    height = 0.4 if mesh == "box.stl" else 0.2
    assert server.scene._handle_from_node_name["/labels/rover"].position[2] == pytest.approx(1.0 + height + GAP)


def test_a_robot_with_a_spherical_joint_is_drawn(server: Any) -> None:
    arm = URDF.removeprefix('<robot name="r">').replace('name="b"', 'name="arm"')
    joint = '<joint name="j" type="spherical"><origin xyz="0 0 1"/><parent link="b"/><child link="arm"/></joint>'
    robot = Robot(server, "r", BodyDescription(urdf=URDF.replace("</robot>", joint + arm)))
    robot.show(Sight(bases={"b": Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))}))
    assert not robot.fault
    assert server.scene._handle_from_node_name["/labels/r"].position[2] == pytest.approx(1.2 + GAP)


def test_a_robot_has_the_colours_of_its_description_in_daylight(server: Any, tmp_path: Path) -> None:
    """Of a material that another link defines too, and of a mesh's own. Metal would be black without surroundings."""
    shapes = '<box size="1 1 1"/>', '<capsule radius="1" length="2"/>', '<mesh filename="cube.obj"/>'
    red = '<material name="red"><color rgba="1 0 0 1"/></material>', '<material name="red"/>', ""
    links = [
        f'<link name="link_{k}"><visual><geometry>{shapes[k]}</geometry>{red[k]}</visual></link>'
        f'<joint name="joint_{k}" type="fixed"><parent link="base"/><child link="link_{k}"/></joint>'
        for k in range(3)
    ]
    (tmp_path / "cube.obj").write_text("mtllib cube.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "cube.mtl").write_text("newmtl red\nKd 1 0 0\n")
    urdf = f'<robot name="r"><link name="base"/>{"".join(links)}</robot>'
    assert not Robot(server, "r", BodyDescription(urdf=urdf, urdf_file=str(tmp_path / "robot.urdf"))).fault
    drawn = [handle for handle in server.scene._handle_from_node_name.values() if hasattr(handle, "glb_data")]
    assert len(drawn) == 3
    for handle in drawn:
        material = trimesh.load_mesh(io.BytesIO(handle.glb_data), file_type="glb").visual.material
        assert material.main_color.tolist() == [255, 0, 0, 255] and material.metallicFactor == 0.0


def test_each_of_two_robots_is_where_its_own_frame_is(server: Any) -> None:
    """The first has short names, the other prefixed ones."""
    places = {"one": (3.0, 4.0), "two": (-1.0, 2.0)}
    poses = {name: Pose((*place, 1.0), (1.0, 0.0, 0.0, 0.0)) for name, place in places.items()}
    appearances = {name: BodyDescription(shape=BodyDescription.ROBOT, urdf=URDF) for name in places}
    sight = Sight(poses=poses, appearances=appearances, bases={"b": poses["one"], "two/b": poses["two"]})
    (scene := Scene(server)).show(Ground(), sight)
    labels = server.scene._handle_from_node_name
    for name, place in places.items():
        label = labels[f"/labels/{name}"]
        assert label.text == name and label.visible
        assert np.allclose(label.position[:2], place) and label.position[2] > 1.2, "above it"
    scene.show(Ground(), Sight())
    assert "/labels/one" not in labels


def test_a_box_is_drawn_where_its_centre_is(server: Any) -> None:
    """Beside the centre of mass, and turned with the body."""
    sight, size = Sight(), [0.4, 0.2, 0.2]
    described = BodyDescription(id="hand", tracked=True, shape=BodyDescription.BOX, dimensions=size)
    sight.take("body_descriptions", serialize_message(BodyDescriptionArray(bodies=[described])))
    pose = pose_message((1.0, 2.0, 3.0), yaw=0.5 * math.pi)
    body = TrackedBody(id="hand", pose=pose, shape=TrackedBody.SHAPE_BOX, dimensions=size, centre=[0.25, 0.0, 0.5])
    sight.take("tracked_bodies", serialize_message(TrackedBodyArray(bodies=[body])))
    Scene(server).show(Ground(), sight)
    [box] = [handle for path, handle in server.scene._handle_from_node_name.items() if path.startswith("/bodies/")]
    np.testing.assert_allclose(box.batched_positions, [[1.0, 2.25, 3.5]], atol=1e-6)


@pytest.mark.parametrize(
    ("urdf", "file", "fault"),
    [
        ("", "/gone.urdf", "its file /gone.urdf is gone from the node"),
        ("<robot", "", "cannot be read (unclosed"),
    ],
)
def test_a_robot_that_cannot_be_drawn_is_the_box_around_its_links_and_the_page_says_why(
    server: Any, urdf: str, file: str, fault: str
) -> None:
    """The node describes a robot anew, then without its text, when another body comes."""
    sight, described = Sight(), BodyDescription(id="r", shape=BodyDescription.ROBOT, urdf=urdf, urdf_file=file)
    sight.take("body_descriptions", serialize_message(BodyDescriptionArray(bodies=[described])))
    state = TrackedBody(id="r", pose=pose_message((1.0, 2.0, 3.0)), shape=TrackedBody.SHAPE_BOX)
    state.dimensions, state.centre = [0.5, 0.25, 1.0], [0.25, 0.0, 0.5]
    sight.take("body_states", serialize_message(TrackedBodyArray(bodies=[state])))
    scene, drawn = Scene(server), server.scene._handle_from_node_name
    scene.show(Ground(), sight)
    [box] = [handle for path, handle in drawn.items() if path.startswith("/bodies/")]
    assert box.batched_positions.tolist() == [[1.25, 2.0, 3.5]]
    assert np.ptp(box.vertices, axis=0).tolist() == [0.5, 0.25, 1.0]
    assert drawn["/labels/r"].visible
    [words] = scene.faults
    assert words.startswith("r is drawn as a box: ") and fault in words


def test_bodies_of_nearly_the_same_size_are_all_drawn(server: Any) -> None:
    sizes = {"one": 0.25, "two": 0.2500001}
    appearances = {name: BodyDescription(shape=BodyDescription.SPHERE, dimensions=[r]) for name, r in sizes.items()}
    poses = {name: Pose((100.0 * r, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for name, r in sizes.items()}
    Scene(server).show(Ground(), Sight(poses=poses, appearances=appearances))
    assert sum(path.startswith("/bodies/") for path in server.scene._handle_from_node_name) == 2


def test_a_robot_that_comes_again_under_its_short_names_is_not_where_it_was(server: Any) -> None:
    """Its frames had a prefix while another robot had the short names."""
    sight = Sight()
    for names, frame, x in ((("one", "two"), "two/b", 1.0), (("one",), "b", 2.0), (("two",), "b", 5.0)):
        bodies = [BodyDescription(id=name, shape=BodyDescription.ROBOT, urdf=URDF) for name in names]
        sight.take("body_descriptions", serialize_message(BodyDescriptionArray(bodies=bodies)))
        place = Odometry(child_frame_id=frame)
        place.pose.pose = pose_message((x, 0.0, 1.0))
        sight.take("odometry", serialize_message(place))
    Scene(server).show(Ground(), sight)
    assert server.scene._handle_from_node_name["/labels/two"].position[0] == pytest.approx(5.0)


def test_a_page_is_refreshed_by_the_thread_that_sends_it(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """From another thread, viser now and then failed with "deque mutated during iteration"."""
    loops: list[Any] = []
    page = Page.__new__(Page)
    page._server = server

    async def refresh(_: Page) -> None:
        loops.append(asyncio.get_running_loop())

    monkeypatch.setattr(Page, "_refresh", refresh)
    page.refresh()
    assert loops == [server.get_event_loop()]


@pytest.mark.parametrize("host", ["203.0.113.1", "nowhere.invalid", "a..b"])
def test_a_host_that_is_not_this_machine_is_refused(host: str) -> None:
    """viser would wait forever."""
    with pytest.raises(InputError, match=f"cannot listen on '{host}': .* name an address of this machine"):
        start_server(host, 0)


def test_addresses_are_those_of_a_browser() -> None:
    assert url_of("0.0.0.0", 8080) == url_of("::", 8080) == url_of("", 8080) == "http://localhost:8080"
    assert url_of("::1", 8080) == "http://[::1]:8080"


def test_a_view_of_a_node_needs_no_matplotlib() -> None:
    code = "import sys; sys.modules['matplotlib'] = None; from smartmesh_ros.tools.view import main, page"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=TIMEOUT)


def test_an_option_that_means_nothing_is_named(domain: int, capsys: pytest.CaptureFixture[str]) -> None:
    with Process("view", arguments=["--port", "0", "--node", "a b"]) as view:
        assert view.process.wait(TIMEOUT) == 1
        assert "view: " in view.output and "full name" in view.output and "Traceback" not in view.output
    for option, value, words in (("--rate", "0", "'0' is no number from 1"), ("--port", "99999", "no whole number")):
        with pytest.raises(SystemExit, match="2"):
            main([option, value])
        assert words in capsys.readouterr().err
