"""The ground at points: its height, normal, velocity and age, against all facets of the main mesh.

A point in a gap between height maps has one height, whoever asks.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import BodyState, HeightMap, InputError, PhysicsConfig, Sphere, Terrain, World, WorldConfig
from smartmesh_ros.terrain.surface_query import GroundSamples, RayCaster, checked_points, checked_rays, ground_samples
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.grounds import terrain_of
from tests.terrain.surfaces import highest, triangles_of

RESOLUTION, RATE, LAST = 0.25, 60.0, 6


def wave(x: np.ndarray, y: np.ndarray, time: float) -> np.ndarray:
    """Waves of angular frequency 4/s."""
    return np.asarray(0.3 * np.sin(x + 0.4 * y - 4.0 * time) + 0.05 * np.cos(3.0 * y))


def wave_map(yaw: float = 0.0, holes: int = 0) -> HeightMap:
    """A map of 70 x 90 samples (more than one block) after maps at 60 Hz."""
    r, c = np.mgrid[:70, :90]
    x, y = RESOLUTION * c, RESOLUTION * r
    heights = wave(x, y, 0.0)
    heights.ravel()[np.random.default_rng(5).integers(0, heights.size, holes)] = np.nan
    gone = np.isnan(heights)
    heightmap = HeightMap(heights, resolution=RESOLUTION, origin=(-3.0, 2.0, 0.7), yaw=yaw, time=0.0)
    for number in range(1, LAST + 1):
        heights = wave(x, y, number / RATE)
        heights[gone] = np.nan
        heightmap.replace(heights, time=number / RATE)
    return heightmap


def points_on(heightmap: HeightMap, count: int, seed: int = 0, beyond: float = 1.0) -> np.ndarray:
    """Points (N, 2) on the map and up to ``beyond`` samples beside it."""
    rng, geometry = np.random.default_rng(seed), heightmap.geometry
    rows = rng.uniform(-beyond, geometry.rows - 1 + beyond, count)
    return geometry.to_world(rows, rng.uniform(-beyond, geometry.columns - 1 + beyond, count))


def at(ground: HeightMap | TriangleMesh | Terrain, points: np.ndarray, time: float) -> GroundSamples:
    return ground_samples(Terrain.of(ground), checked_points(points), time)


@settings(max_examples=25, deadline=None)
@given(
    time=st.floats(LAST / RATE - 0.005, LAST / RATE + 0.04), yaw=st.sampled_from([0.0, 0.8, -2.5]),
    holes=st.sampled_from([0, 900]),
)  # fmt: skip
def test_waves_between_maps_are_the_main_mesh(time: float, yaw: float, holes: int) -> None:
    heightmap = wave_map(yaw, holes)
    points = points_on(heightmap, 150)
    found, expected = at(heightmap, points, time), highest(triangles_of(heightmap, time), checked_points(points))
    assert np.isnan(expected.values).any()
    np.testing.assert_allclose(found.z, expected.values, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.normals, expected.normals, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.ages[~np.isnan(found.z)], time - LAST / RATE, atol=1e-12)
    for values in (found.normals, found.velocities, found.ages):
        np.testing.assert_array_equal(np.isnan(values.reshape(len(points), -1)).any(axis=1), np.isnan(found.z))


def test_velocity_is_the_rate_of_the_height() -> None:
    heightmap, time, step = wave_map(), LAST / RATE + 0.004, 1e-4
    points = points_on(heightmap, 300, beyond=-0.1)
    before, now, after = (at(heightmap, points, time + by) for by in (-step, 0.0, step))
    np.testing.assert_allclose(now.velocities[:, 2], (after.z - before.z) / (2 * step), atol=1e-5)
    assert np.abs(now.velocities[:, 2]).max() > 1.0
    assert not now.velocities[:, :2].any()


def test_ground_that_slides_and_turns_carries_its_points() -> None:
    r, c = np.mgrid[:30, :40]
    heightmap = HeightMap(wave(0.1 * c, 0.1 * r, 0.0), resolution=0.1, origin=(1.0, 2.0), yaw=0.3)
    heightmap.slide((0.8, -0.3), 0.1, spin=0.5)
    time, step = 0.02, 1e-5
    points = heightmap.placed_at(time).to_world(*np.random.default_rng(1).uniform(3.0, 25.0, (2, 200)))
    now = at(heightmap, points, time)
    later = at(heightmap, points + step * now.velocities[:, :2], time + step)
    np.testing.assert_allclose(later.z, now.z, atol=1e-8)
    assert np.linalg.norm(now.velocities[:, :2], axis=1).max() > 0.5


def test_age_is_that_of_the_block() -> None:
    heightmap = wave_map()
    heightmap.update_region(0, 0, np.ones((3, 3)), time=0.5)
    points = heightmap.geometry.to_world(np.array([1.5, 65.5]), np.array([1.5, 70.5]))
    np.testing.assert_allclose(at(heightmap, points, 0.75).ages, [0.25, 0.75 - LAST / RATE])


def test_an_edge_of_a_whole_facet_is_ground_beside_a_hole() -> None:
    heights = np.ones((5, 5))
    heights[2, 3] = np.nan
    heightmap = HeightMap(heights, resolution=1.0)
    #         on an edge of facets on its left only; inside the hole; on the hole's corner
    points = np.array([[2.0, 2.5], [2.5, 2.2], [3.0, 2.0], [2.0, 2.0], [4.0, 4.0]])
    np.testing.assert_array_equal(np.isnan(at(heightmap, points, 0.0).z), [False, True, True, False, False])


def halves(gap: int) -> tuple[HeightMap, Terrain]:
    """A map, and the same one as two tiles; with ``gap`` 1 they share no samples."""
    r, c = np.mgrid[:20, :40]
    heights = wave(0.2 * c, 0.2 * r, 0.0)
    first, whole = 19 + gap, HeightMap(heights, resolution=0.2)
    right = HeightMap(heights[:, first:], resolution=0.2, origin=(0.2 * first, 0.0))
    return whole, terrain_of(left=HeightMap(heights[:, :20], resolution=0.2), right=right)


@pytest.mark.parametrize("gap", [0, 1])
def test_tiles_are_one_surface(gap: int) -> None:
    whole, terrain = halves(gap)
    points = points_on(whole, 400, beyond=0.0)
    points[:100, 0] = np.linspace(3.75, 4.05, 100)  # about the seam
    one, two = at(whole, points, 0.0), at(terrain, points, 0.0)
    for expected, found in zip(one, two, strict=True):
        np.testing.assert_allclose(found, expected, atol=2e-6)
    np.testing.assert_array_equal(np.isnan(two.z), np.isnan(one.z))


def test_a_hole_of_one_tile_shows_the_next_below() -> None:
    heights = np.ones((5, 5))
    heights[2, 2] = np.nan
    terrain = Terrain(HeightMap(heights, resolution=1.0))
    terrain.put("below", HeightMap(np.zeros((5, 5)), resolution=1.0))
    np.testing.assert_allclose(at(terrain, np.array([[2.0, 2.1], [0.5, 0.5]]), 0.0).z, [0.0, 1.0])
    np.testing.assert_allclose(at(terrain, np.array([[0.5, 0.5, 0.8], [0.5, 0.5, 1.0]]), 0.0).z, [0.0, 1.0])


def folded_mesh(seed: int) -> TriangleMesh:
    """Two uneven sheets, one above the other."""
    rng = np.random.default_rng(seed)
    r, c = np.mgrid[:12, :9]
    sheet = np.stack([c, r, np.zeros_like(r)], axis=-1).reshape(-1, 3) + rng.uniform(-0.4, 0.4, (108, 3))
    triangles = grid_triangles(12, 9)
    vertices = np.concatenate([sheet, sheet * (0.5, 0.5, 1.0) + (1.0, 2.0, 3.0)])
    return TriangleMesh(vertices, np.concatenate([triangles, triangles + 108]))


@pytest.mark.parametrize("seed", range(5))
def test_a_general_mesh_is_its_highest_triangle_below_the_point(seed: int) -> None:
    mesh = folded_mesh(seed)
    mesh.move(mesh.vertices + 0.1, time=0.1)
    time, rng = 0.15, np.random.default_rng(seed + 10)
    points = np.column_stack([rng.uniform(-1.0, 12.0, (400, 2)), rng.choice([1.5, np.inf], 400)])
    moved = mesh.sample(np.arange(mesh.size), time).positions
    expected = highest(moved[mesh.triangles], points, slack=0.0)
    found = at(mesh, points, time)
    np.testing.assert_allclose(found.z, expected.values, atol=1e-12)
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-9)
    there = ~np.isnan(found.z)
    assert 0 < there.sum() < 400
    np.testing.assert_allclose(found.velocities[there], 1.0, rtol=1e-6)
    np.testing.assert_allclose(found.ages[there], 0.05)


@pytest.mark.parametrize(
    "points", [[[0.0]], [[math.nan, 0.0]], [[0.0, math.inf]], [[-1e300, 0.0]], [["a", "b"]], [0.0, 0.0]]
)
def test_bad_points_are_refused(points: list[list[float]]) -> None:
    with pytest.raises(InputError, match="points"):
        checked_points(points)


def test_without_ground_all_is_nan() -> None:
    found = at(Terrain(), np.zeros((3, 2)), 0.0)
    assert all(np.isnan(values).all() for values in found)
    assert found.normals.shape == (3, 3)


COUNT = 400


def two_tiles(first: float, second: float, gap: float, seed: int, shift: float = 0.0) -> Terrain:
    """Return two moving tiles of 10 m x 10 m with these resolutions [m] on both sides of x = 0 and x = ``gap`` [m]."""
    rng, terrain = np.random.default_rng(seed), Terrain()
    for name, resolution, x, y in (("a", first, -10.0, 0.0), ("b", second, gap, shift)):
        side = round(10.0 / resolution) + 1
        heights = rng.normal(scale=0.3, size=(side, side))
        tile = HeightMap(heights, resolution=resolution, origin=(x, y, 0.0))
        tile.replace(heights + rng.normal(scale=0.05, size=heights.shape), time=0.05)
        terrain.put(name, tile)
    return terrain


def in_gap(gap: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0.0, gap, COUNT), rng.uniform(1.0, 9.0, COUNT)])


def heights_of(terrain: Terrain, points: np.ndarray, time: float) -> dict[str, np.ndarray]:
    """Return the heights (N,) [m] that samples, queries, rays straight down and slanted rays find."""
    z = ground_samples(terrain, checked_points(points), time).z
    above = np.column_stack([points, np.full(len(points), 5.0)])
    down = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    caster = RayCaster(terrain)
    return {
        "samples": terrain.at(points, time).heights,
        "queries": z,
        "rays": 5.0 - caster.cast(checked_rays(above, down, 10.0), time).distances,
    }


@pytest.mark.parametrize("gap", (0.05, 0.35, 0.5))
@pytest.mark.parametrize(("first", "second"), ((0.5, 0.5), (0.5, 0.1), (0.1, 0.5), (0.5, 0.03)))
@pytest.mark.parametrize("shift", (0.0, 0.123))
def test_all_find_the_same_height(first: float, second: float, gap: float, shift: float) -> None:
    terrain, points = two_tiles(first, second, gap, 1, shift), in_gap(gap, 2)
    for time in (0.05, 0.06):
        found = heights_of(terrain, points, time)
        assert np.isfinite(found["samples"]).all()
        np.testing.assert_array_equal(found["queries"], found["samples"])
        np.testing.assert_allclose(found["rays"], found["samples"], atol=1e-9)


@pytest.mark.parametrize(("first", "second"), ((0.5, 0.5), (0.5, 0.1), (0.1, 0.5)))
def test_the_bridge_between_level_tiles_is_a_plane(first: float, second: float) -> None:
    terrain, points = two_tiles(first, second, 0.5, 3), in_gap(0.5, 4)
    for name, level in (("a", 0.0), ("b", 1.0)):
        tile = terrain.tiles[name]
        tile.replace(np.full((tile.geometry.rows, tile.geometry.columns), level), time=1.0)
    np.testing.assert_allclose(terrain.at(points, 9.0).heights, points[:, 0] / 0.5, atol=1e-9)


@pytest.mark.parametrize(("first", "second"), ((0.5, 0.5), (0.5, 0.1), (0.1, 0.5)))
def test_the_bridge_meets_the_edge_of_the_finer_tile(first: float, second: float) -> None:
    terrain, y = two_tiles(first, second, 0.5, 3), np.linspace(1.0, 9.0, COUNT)
    edge, inwards = (0.0, 1.0) if first <= second else (0.5, -1.0)
    on, beside = (
        terrain.at(np.column_stack([np.full(COUNT, x), y]), 0.05).heights for x in (edge, edge + 1e-5 * inwards)
    )
    np.testing.assert_allclose(beside, on, atol=1e-3)


def test_wider_gaps_and_holes_are_no_ground() -> None:
    terrain = two_tiles(0.5, 0.1, 1.01, 5)
    for found in heights_of(terrain, in_gap(1.01, 6)[:50], 0.05).values():
        assert not np.isfinite(found).any()
    terrain = two_tiles(0.5, 0.1, 0.5, 7)
    tile = terrain.tiles["a"]
    heights = tile.heights.copy()
    heights[:, -1] = np.nan
    tile.replace(heights, time=0.1)
    points = np.array([[-0.25, 5.0], [-0.01, 5.0], [0.25, 5.0]])
    for found in heights_of(terrain, points, 0.1).values():
        assert not np.isfinite(found).any()


def test_a_ball_lies_on_the_bridge_that_queries_find() -> None:
    terrain = two_tiles(0.5, 0.1, 0.5, 8)
    with World(terrain, WorldConfig(physics=PhysicsConfig())) as world:
        world.step(24)  # the ground comes to rest
        for number, (x, y) in enumerate(in_gap(0.5, 9)[:20]):
            found = terrain.at([[x, y]], world.time).heights
            world.spawn(f"ball {number}", Sphere(0.02), 1.0, BodyState((x, y, float(found[0]) + 0.05)))
        world.step(60)
        for name in world.bodies:
            x, y, z = world.state(name).position
            sample = world.ground.at([[x, y]], world.time)
            if not np.isnan(sample.z[0]):  # it has not rolled out
                assert z - sample.z[0] > 0.02 * sample.normals[0, 2] - 1e-3
