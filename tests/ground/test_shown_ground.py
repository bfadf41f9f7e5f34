"""The ground in PyBullet's pictures and for its rays: where it is, what it looks like, and that nothing touches it."""

import math
import tracemalloc
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import Deck, Ground, HeightMap, Sphere
from smartmesh_ros.terrain.colours import FRICTION, GROUND
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.bodies import ground_of, height, put, run
from tests.core import mesh_parts
from tests.grounds import level, terrain_of

DT = 1.0 / 240.0
# Rows and columns of a hole and of ice in `scenery`.
HOLE, ICE = (slice(10, 20), slice(25, 35)), (slice(30, 45), slice(5, 20))
SKY, OTHER = 7, 8  # values of `picture`


def scenery(yaw: float = 0.4) -> HeightMap:
    """Hills with a hole and ice, 6 m wide."""
    rng = np.random.default_rng(3)
    heights, friction = rng.uniform(-0.1, 0.1, (51, 61)), np.ones((51, 61))
    heights[HOLE], friction[ICE] = np.nan, 0.1
    return HeightMap(heights, resolution=0.1, origin=(-2.0, -3.0, 0.7), yaw=yaw, friction=friction)


def picture(client: Any, renderer: int) -> Any:
    """Return what a camera above sees of the scenery at each pixel (240, 320): a band of friction, ground, `SKY` or
    `OTHER`."""
    heightmap = scenery()
    ground = Ground(client, heightmap)
    ground.show()
    x, y = heightmap.geometry.to_world(25.0, 30.0).tolist()
    view = client.computeViewMatrix((x, y, 40.0), (x, y, 0.0), (0.0, 1.0, 0.0))
    lens = client.computeProjectionMatrixFOV(11.0, 4.0 / 3.0, 1.0, 100.0)
    image = client.getCameraImage(320, 240, view, lens, shadow=0, lightDirection=(0.0, 0.0, 1.0), renderer=renderer)
    pixels = np.array(image[2], np.float64).reshape(240, 320, 4)[..., :3]
    ground.close()
    colours = np.array([*FRICTION.values(), GROUND], np.float64)
    unit = [each / np.linalg.norm(each, axis=-1, keepdims=True) for each in (pixels, colours)]
    apart = np.linalg.norm(unit[0][..., None, :] - unit[1], axis=-1)
    found = np.where(apart.min(axis=-1) < 0.05, apart.argmin(axis=-1), OTHER)
    return np.where((pixels == pixels[0, 0]).all(axis=-1), SKY, found)


def rays(client: Any, yaw: float = 0.4) -> FloatArray:
    """Return how far rays come that fall onto the scenery from all sides (1000,) [m], infinity = past it."""
    heightmap = scenery(yaw)
    ground = Ground(client, heightmap)
    ground.show()
    starts, ends = falling(heightmap)
    hits = client.rayTestBatch(starts.tolist(), ends.tolist())
    assert {hit[0] for hit in hits} == {-1, ground.shown[""]}
    return np.array([hit[2] if hit[0] >= 0 else math.inf for hit in hits])


def falling(heightmap: HeightMap) -> tuple[FloatArray, FloatArray]:
    """Start and end (1000, 3) [m] of rays above and below a map."""
    rng = np.random.default_rng(4)
    grid = rng.uniform(-2.0, 62.0, (2, 1000, 2))
    places = [heightmap.geometry.to_world(each[:, 0], each[:, 1]) for each in grid]
    return np.column_stack([places[0], np.full(1000, 2.0)]), np.column_stack([places[1], np.full(1000, -1.0)])


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -3.0])
def test_rays_meet_the_ground_where_it_is(client: Any, yaw: float) -> None:
    """And pass through holes, and past the edge."""
    heightmap = scenery(yaw)
    starts, ends = falling(heightmap)
    lengths = np.linalg.norm(ends - starts, axis=1)
    wanted = Ground(client, heightmap).cast_rays(starts, (ends - starts) / lengths[:, None], 100.0, 0.0).distances
    client.resetSimulation()
    np.testing.assert_allclose(rays(client, yaw) * lengths, np.where(wanted < lengths, wanted, math.inf), atol=1e-5)


def test_rays_meet_the_tiles_of_a_deck_where_it_is(client: Any) -> None:
    terrain, deck = terrain_of(sea=level()), Deck(scenery())
    vertices, triangles = mesh_parts.sheet(4.0, 20, lambda x, y: 0.1 * np.sin(3.0 * x))
    deck.put("roof", TriangleMesh(vertices + [0.0, 0.0, 4.0], triangles))
    terrain.put("ferry", deck)
    ground = Ground(client, terrain)
    ground.show()
    starts = np.column_stack([np.random.default_rng(5).uniform(-3.0, 6.0, (500, 2)), np.full(500, 20.0)])
    down = np.tile([0.0, 0.0, -1.0], (500, 1))
    for time, angle in ((1.0, 0.0), (2.0, 0.3), (3.0, -0.2)):
        deck.place((1.0, -1.0, 3.0 + time), (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)), time=time)
        ground.update(time, DT)
        hits = client.rayTestBatch(starts.tolist(), (starts + 30.0 * down).tolist())
        assert {hit[0] for hit in hits} >= {ground.shown["ferry"], ground.shown["ferry/roof"]}
        found = np.array([30.0 * hit[2] if hit[0] >= 0 else math.inf for hit in hits])
        np.testing.assert_allclose(found, ground.cast_rays(starts, down, 30.0, time).distances, atol=1e-4)


def test_pictures_show_holes_and_the_colours_of_friction(client: Any) -> None:
    seen, geometry = picture(client, pb.ER_TINY_RENDERER), scenery().geometry
    per_pixel = 2.0 * (40.0 - 0.7) * math.tan(math.radians(5.5)) / 240  # [m]
    plain = len(FRICTION)
    for row, column, value in ((14.5, 29.5, SKY), (37.0, 12.0, 0), (14.5, 45.0, plain), (37.0, 29.5, plain)):
        x, y = (geometry.to_world(row, column) - geometry.to_world(25.0, 30.0)) / per_pixel
        assert seen[round(119.5 - y), round(159.5 + x)] == value
    assert not (seen == OTHER).any()


def test_pictures_of_friction_that_changes_are_kept_by_pybullet_alone(client: Any) -> None:
    rng, heightmap = np.random.default_rng(1), HeightMap(np.zeros((100, 100)), resolution=0.1)
    ground = Ground(client, heightmap)
    ground.show()
    tracemalloc.start()
    for number in range(1, 21):  # pictures of 30 kB
        heightmap.replace(np.zeros((100, 100)), time=0.1 * number, friction=rng.choice([0.1, 1.0], (100, 100)))
        ground.update(0.1 * number, DT)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept < 300_000


def close_up(client: Any, renderer: int) -> set[int]:
    """Return what is seen from 3 cm beside the foot of a ball of 0.5 mm: 0 = the ball, -1 = nothing."""
    ball = put(client, Sphere(5e-4), (0.0, 0.0, 5e-4))
    ground = ground_of(client, level(), ball)
    ground.step(0.0, DT)
    view = client.computeViewMatrix((0.02, 0.0, 0.02), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    lens = client.computeProjectionMatrixFOV(20.0, 4.0 / 3.0, 1e-3, 10.0)
    image = client.getCameraImage(320, 240, view, lens, renderer=renderer)
    return {int(body) - ball if body >= 0 else -1 for body in np.unique(image[4])}


def test_pictures_show_no_proxies(client: Any) -> None:
    assert close_up(client, pb.ER_TINY_RENDERER) == {-1, 0}


def test_nothing_touches_what_is_shown(client: Any) -> None:
    """A body that is not attached falls through; one that is has the contacts of before, and rays meet both."""
    stands, falls = put(client, Sphere(0.2), (0.0, 0.0, 0.2)), put(client, Sphere(0.2), (1.0, 0.0, 0.3))
    ground = ground_of(client, level(), stands)
    ground.show()
    run(ground, 120)
    assert height(client, stands) == pytest.approx(0.2, abs=1e-4)
    assert height(client, falls) < -0.8
    assert not client.getContactPoints(ground.shown[""])
    hits = [client.rayTest((x, y, 2.0), (x, y, -2.0))[0][0] for x, y in ((0.0, 0.0), (0.19, 0.19), (1.0, 0.0))]
    assert hits == [stands, *[ground.shown[""]] * 2]
    assert [ground.is_ground(body) for body in hits] == [False, True, True]


def test_a_tile_that_is_removed_from_pybullet_is_drawn_again_and_who_gets_its_number_stays(client: Any) -> None:
    terrain = level()
    ground = ground_of(client, terrain)
    ground.show()
    tile = ground.shown[""]
    for ends in (lambda: terrain.replace(np.full((41, 41), 0.1), time=1.0), ground.hide):
        client.removeBody(tile)
        ball = put(client, Sphere(0.2), (5.0, 0.0, 1.0))
        assert ball == tile and not ground.is_ground(ball)
        ends()
        run(ground, 30)
        assert client.getBasePositionAndOrientation(ball)[0][:2] == pytest.approx((5.0, 0.0), abs=1e-3)
        tile = ground.shown.get("", -1)
        assert ground.is_ground(tile) == bool(ground.shown)
    assert client.getNumBodies() == 2


def height_under(client: Any, x: float = 0.0, y: float = 0.0, above: float = 900.0) -> float:
    """Height at which a ray that comes down meets anything [m]."""
    (hit,) = client.rayTest((x, y, above), (x, y, -900.0))
    return float(hit[3][2]) if hit[0] >= 0 else math.nan


def test_ground_is_drawn_at_its_rate_far_from_where_it_began(client: Any) -> None:
    """PyBullet keeps the bounds that a height field has at first."""
    terrain = level(motion=MotionConfig(mode="hold"))
    ground = ground_of(client, terrain, put(client, Sphere(0.2), (1.0, 1.0, 500.0)))
    ground.show(rate=10.0)
    heights = np.zeros((41, 41))
    for step in range(72):
        heights[:, :21] = -4.0 * step
        terrain.replace(heights, time=step * DT)
        ground.step(step * DT, DT)
        wanted = -4.0 * 24 * (step // 24)
        assert height_under(client, -1.0, above=wanted + 5.0) == pytest.approx(wanted, abs=1e-4)
    ground.show()
    assert height_under(client, -1.0) == pytest.approx(-4.0 * 71, abs=1e-4)


def test_a_correction_is_drawn_to_its_end(client: Any) -> None:
    terrain = level(motion=MotionConfig(changes="correction", settle=0.15))
    ground = ground_of(client, terrain, put(client, Sphere(0.2), (1.0, 1.0, 0.2)))
    ground.show(rate=5.0)
    ground.step(0.0, DT)
    for step in range(1, 120):
        if step == 36:  # so that the third drawing shows a part of it
            terrain.replace(np.full((41, 41), 0.05), time=step * DT)
        ground.step(step * DT, DT)
    assert height_under(client) == pytest.approx(0.05, abs=1e-6)


def test_tiles_come_move_and_go(client: Any) -> None:
    """Maps, also large ones, which are drawn coarsely, and meshes."""
    fine = HeightMap(np.full((600, 700), 0.3), resolution=0.01, origin=(10.0, -1.0))
    vertices, triangles = mesh_parts.sheet(1.0, 3)
    terrain = terrain_of(map=level(), fine=fine, mesh=TriangleMesh(np.array(vertices) + (0.0, 0.0, 2.0), triangles))
    ground = Ground(client, terrain)
    bodies = client.getNumBodies()
    ground.show()
    assert [height_under(client, x) for x in (1.9, 12.0)] == pytest.approx([0.0, 0.3], abs=1e-5)
    assert height_under(client, 0.2, 0.3) == pytest.approx(2.0, abs=1e-5)
    terrain.put("map", HeightMap(np.full((5, 5), 1.0), resolution=0.5, origin=(-5.0, -1.0)))
    terrain.remove("mesh")
    ground.show(20.0)
    assert ground.drawn == 20.0
    assert [height_under(client, x) for x in (-4.0, 0.2, 1.9)] == pytest.approx([1.0, math.nan, math.nan], nan_ok=True)
    assert sorted(ground.shown) == ["fine", "map"]
    ground.hide()
    assert client.getNumBodies() == bodies and not ground.shown
