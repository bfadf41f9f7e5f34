"""What the page draws of terrain, without a browser: clicks, colours of ruts and materials, decks."""

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovariance
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from smartmesh_msgs.msg import BodyDescription, HeightmapUpdate

from smartmesh_ros.tools.client.patch import Patch
from smartmesh_ros.tools.testing import floats, heightmap_message, mesh_message, pose_message
from tests.bodies import about_z, rotation

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")

from smartmesh_ros.tools.client.ground import Ground
from smartmesh_ros.tools.client.sight import Pose, Sight
from smartmesh_ros.tools.view.scene import Scene
from smartmesh_ros.tools.view.terrain_scene import Depth, Give, Grip, TerrainScene, triangles_by_band


def give(ground: Ground, message: Any, topic: str = "heightmap") -> None:
    """A message, or its bytes."""
    ground.take(topic, message if isinstance(message, bytes) else serialize_message(message))
    ground.apply_waiting()


def patch_of(kind: str, tile: str, vertices: np.ndarray, *triangles: Any, row: int = 0, column: int = 0) -> Patch:
    return Patch(
        name="body", kind=kind, tile=tile, row=row, column=column, stride=1, deviation=0.0, linear_w=np.zeros(3),
        angular_w=np.zeros(3), vertices_w=vertices, triangles=np.array(triangles, np.uint32).reshape(-1, 3),
    )  # fmt: skip


def ground_of(heights: np.ndarray, **options: object) -> Ground:
    ground = Ground()
    give(ground, heightmap_message(heights, **options))
    return ground


def test_a_click_meets_the_nearest_body_on_its_way() -> None:
    ball = BodyDescription(shape=BodyDescription.SPHERE, dimensions=[0.5])
    poses = {name: Pose((x, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for name, x in (("far", 8.0), ("near", 4.0))}
    sight = Sight(poses=poses, appearances={"far": ball, "near": ball})
    for y, way, hit in ((0.0, 1.0, "near"), (0.0, -1.0, None), (2.0, 1.0, None)):
        assert sight.hit(np.array([0.0, y, 0.0]), np.array([way, 0.0, 0.0])) == hit


def test_regions_are_written_into_the_map_and_a_new_map_replaces_them() -> None:
    ground = ground_of(np.zeros((6, 8)), yaw=0.3)
    region = HeightmapUpdate(x=2, y=1, width=3, height=2, heights=floats(np.ones((2, 3), np.float32)))
    give(ground, region, "heightmap_update")
    expected = np.zeros((6, 8))
    expected[1:3, 2:5] = 1.0
    assert np.array_equal(ground.tiles[""].heights, expected)
    assert ground.tiles[""].geometry.yaw == pytest.approx(0.3)
    ground.take("heightmap_update", serialize_message(region))
    impossible = serialize_message(heightmap_message(np.zeros((6, 8)), resolution=-1.0))
    for number, spoilt in enumerate((b"", b"\0\1\0\0" + bytes(40), serialize_message(region)[:-4], impossible)):
        ground.take("heightmap", serialize_message(heightmap_message(np.full((6, 8), number))))
        give(ground, spoilt)
        give(ground, spoilt, "heightmap_update")
        assert (ground.tiles[""].heights == number).all(), "what makes no sense changes nothing, also of what waits"


def test_of_a_map_that_cannot_be_shown_nothing_is_taken() -> None:
    """What is below the first map of a tile would be looked up in one of another size, which ended the view."""
    ground = ground_of(np.zeros((6, 8)))
    give(ground, heightmap_message(np.zeros((4, 4)), friction=-1.0))
    assert ground.first[""].shape == ground.tiles[""].heights.shape == (6, 8)


@pytest.mark.parametrize(("topic", "message"), [
    ("heightmap", heightmap_message(np.zeros((3, 3)))), ("terrain_mesh", mesh_message(np.eye(3), [(0, 1, 2)])),
])  # fmt: skip
def test_only_the_newest_ground_of_a_tile_waits_for_a_page(topic: str, message: Any) -> None:
    """Else memory would grow by gigabytes while none is open."""
    ground = Ground()
    for _ in range(10):
        ground.take(topic, serialize_message(message))
    assert len(ground._waiting) == 1


def test_every_triangle_that_sank_has_the_colour_of_its_deepest_corner() -> None:
    sunk = np.array([0.0, 0.0009, 0.001, 0.004, 0.005, 0.02, 0.3, -1.0, np.nan])
    triangles = np.array([*([0, 0, corner] for corner in range(len(sunk))), [6, 6, 8]])  # the last is beside a hole
    found = {depth: chosen[:, 2].tolist() for depth, chosen in triangles_by_band(sunk, triangles, Depth)}
    assert found == {Depth.SLIGHT: [2, 3], Depth.SHALLOW: [4], Depth.DEEP: [5], Depth.DEEPEST: [6]}


@pytest.mark.parametrize("topic", ["heightmap_update", "pressed_ground"])
def test_ruts_are_coloured_while_that_is_asked_for(server: Any, drawn: Any, topic: str) -> None:
    ground = ground_of(np.full((40, 40), 3.0), resolution=0.1)
    scene = TerrainScene(server.scene)

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


def test_ground_of_another_material_than_usual_is_coloured_where_it_lies(server: Any, drawn: Any) -> None:
    """The ground of a map that scrolls keeps it; new ground is usual."""
    ground = ground_of(np.zeros((40, 40)), resolution=0.1)
    scene = TerrainScene(server.scene)

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


def test_no_ground_is_drawn_over_a_patch_that_has_moved_since_the_map(server: Any, drawn: Any) -> None:
    """Below it, at the same samples; the ground elsewhere stays."""
    ground = ground_of(np.random.default_rng(0).normal(scale=0.1, size=(40, 40)), resolution=0.1)
    scene = TerrainScene(server.scene)
    tile, (r, c) = ground.tiles[""], np.divmod(np.arange(49), 7)
    rows, columns = 20 + r - 3, 12 + c - 3
    places = tile.geometry.to_world(rows, columns)
    for rise in (-0.2, 0.0):
        vertices = np.column_stack([places, tile.heights[rows, columns] + rise])
        patch = patch_of("heightfield", "", vertices, row=20, column=12)
        scene.show(ground, np.array([[1.2, 2.0, 0.1]]), np.array([0.2]), [patch])
        mesh = drawn["/terrain/tile_"]
        found = {tuple(np.rint(10.0 * v[:2]).astype(int)): v[2] for v in np.asarray(mesh.vertices, float)}
        for k in range(49):
            assert found[(columns[k], rows[k])] == pytest.approx(vertices[k, 2], abs=1e-5)
        assert found[(16, 20)] == pytest.approx(tile.heights[20, 16], abs=1e-5)


def test_tiles_and_patches_of_a_deck_are_drawn_and_clicked_where_its_odometry_says(server: Any, drawn: Any) -> None:
    """Also a patch of a moment ago, when the deck was elsewhere. Rays on any ground: tests/terrain/test_queries.py."""
    ground, sight = ground_of(np.zeros((11, 11)), resolution=1.0), Sight()
    ground.frames = sight.bases
    tile = "ferry/roof"
    give(ground, heightmap_message(np.zeros((5, 5)), resolution=0.5, origin=(-1.0, -1.0, 0.25), tile=tile))
    scene = Scene(server)
    eye, down = np.array([[4.0, 5.0, 99.0]]), np.array([[0.0, 0.0, -1.0]])
    corners, turn = np.array([(0.0, 0.0), (0.5, 0.0), (0.0, 0.5)]), rotation(about_z(0.3))[:2, :2]
    vertices = np.column_stack([corners @ turn.T + (4.0, 5.0), np.ones(3)])
    sight.patches["box"] = patch_of("trimesh", tile, vertices, [0, 1, 2])
    for height in (2.0, 3.0):
        pose = PoseWithCovariance(pose=pose_message((4.0, 5.0, height), yaw=0.3))
        sight.take("odometry", serialize_message(Odometry(child_frame_id="ferry", pose=pose)))
        scene.show(ground, sight)
        frame, mesh = drawn["/decks/ferry"], drawn["/decks/ferry/terrain/tile_ferry%2Froof"]
        assert frame.position == pytest.approx([4.0, 5.0, height])
        assert frame.wxyz == pytest.approx([math.cos(0.15), 0.0, 0.0, math.sin(0.15)])
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        np.testing.assert_allclose([low, high], [[-1.0, -1.0, 0.25], [1.0, 1.0, 0.25]], atol=1e-5)
        patch = drawn["/decks/ferry/patches/mesh"]
        np.testing.assert_allclose(patch.vertices[:, :2], corners, atol=1e-5)
        np.testing.assert_allclose(patch.vertices[:, 2], 0.25, atol=0.01)
        assert ground.distances(eye, down) == pytest.approx(99.0 - height - 0.25)
    assert "/terrain/tile_" in drawn and "/terrain/tile_ferry%2Froof" not in drawn


def test_a_tile_is_drawn_whatever_the_names_of_others_and_stays_when_they_go(server: Any, drawn: Any) -> None:
    ground, scene = Ground(), TerrainScene(server.scene)
    names = ["", "map", "a", "a/b", "a%2Fb", "a/b/c"]
    for gone in ("", *names):
        for name in names:
            message = heightmap_message(np.zeros((0, 0)) if name == gone else np.zeros((5, 5)), tile=name)
            ground.take("heightmap", serialize_message(message))
        ground.apply_waiting()
        scene.show(ground, np.zeros((0, 3)), np.zeros(0), [])
        assert sum(path.startswith("/terrain/") for path in drawn) == len(names) - 1
        assert scene._reliefs.keys() == ground.first.keys() == ground.tiles.keys(), "nothing is kept of what is gone"
