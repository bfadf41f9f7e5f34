"""Points and rays on the ground, against all facets of the main mesh by brute force.

A point in a gap between height maps has one height, whoever asks.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, MotionConfig, Terrain
from smartmesh_ros.terrain.surface_query import (
    GroundHits,
    GroundSamples,
    RayCaster,
    checked_points,
    checked_rays,
    ground_samples,
)
from tests.grounds import terrain_of
from tests.terrain.surfaces import first_hit, folded_mesh, highest, rough_map, triangles_of

LAST = 0.06  # time of the last map of `rough_map` [s]
DOWN = np.array([0.0, 0.0, -1.0])
seeds, yaws, holes = st.integers(0, 10**6), st.sampled_from([0.0, 0.7, -2.0]), st.sampled_from([0, 300])


def at(ground: Any, points: Any, time: float) -> GroundSamples:
    return ground_samples(Terrain.of(ground), checked_points(points), time)


def cast(ground: Any, origins: Any, directions: Any, reach: float, time: float = 0.0) -> GroundHits:
    return RayCaster(Terrain.of(ground)).cast(checked_rays(origins, directions, reach), time)


def points_on(heightmap: HeightMap, count: int, seed: int = 0, beyond: float = 1.0) -> np.ndarray:
    """Points (N, 2) on the map and up to ``beyond`` samples beside it."""
    rng, geometry = np.random.default_rng(seed), heightmap.geometry
    rows = rng.uniform(-beyond, geometry.rows - 1 + beyond, count)
    return geometry.to_world(rows, rng.uniform(-beyond, geometry.columns - 1 + beyond, count))


def rays_at(heightmap: HeightMap, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from above, below and beside a map, most of them flat; some straight down."""
    rng = np.random.default_rng(seed)
    origins = np.column_stack([points_on(heightmap, count, seed, beyond=4.0), rng.uniform(-2.0, 4.0, count)])
    directions = rng.normal(size=(count, 3)) * (1.0, 1.0, 0.2)
    directions[::7] = DOWN
    directions[1::7, 0] = 0.0
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@settings(max_examples=25, deadline=None)
@given(seed=seeds, time=st.floats(LAST + 0.001, LAST + 0.009), yaw=yaws, holes=holes)
def test_points_find_the_highest_facet_and_its_velocity(seed: int, time: float, yaw: float, holes: int) -> None:
    heightmap = rough_map(seed, holes, yaw)
    points, step = points_on(heightmap, 150, seed), 1e-4
    found, expected = at(heightmap, points, time), highest(triangles_of(heightmap, time), checked_points(points))
    np.testing.assert_allclose(found.z, expected.values, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.normals, expected.normals, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(found.z, heightmap.at(points, time).heights)
    before, after = (at(heightmap, points, time + by).z for by in (-step, step))
    np.testing.assert_allclose(found.velocities[:, 2], (after - before) / (2.0 * step), atol=1e-5)
    there = ~np.isnan(found.z)
    assert 0 < there.sum() < 150 and np.abs(found.velocities[there, 2]).max() > 1.0
    np.testing.assert_allclose(found.ages[there], time - LAST, atol=1e-12)
    assert not found.velocities[there, :2].any()
    for values in (found.normals, found.velocities, found.ages):
        np.testing.assert_array_equal(np.isnan(values.reshape(150, -1)).any(axis=1), ~there)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, holes=holes, yaw=yaws)
def test_rays_of_any_length_meet_the_first_facet(seed: int, holes: int, yaw: float) -> None:
    heightmap, time, reach = rough_map(seed, holes, yaw), 0.07, 15.0
    origins, directions = rays_at(heightmap, 60, seed)
    lengths = np.random.default_rng(seed).choice([1e-300, 1.0, 1e200], (60, 1))
    found = cast(heightmap, origins, lengths * directions, reach, time)
    expected = first_hit(triangles_of(heightmap, time), origins, directions, reach)
    np.testing.assert_allclose(found.distances, expected.values, atol=1e-8)
    np.testing.assert_allclose(found.normals, np.sign(expected.normals[:, 2:]) * expected.normals, atol=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_points_and_rays_find_the_triangles_of_a_general_mesh(seed: int) -> None:
    mesh, time, rng = folded_mesh(seed), 0.15, np.random.default_rng(seed + 10)
    facets = triangles_of(mesh, time)
    points = np.column_stack([rng.uniform(-1.0, 12.0, (400, 2)), rng.choice([1.5, np.inf], 400)])
    found, expected = at(mesh, points, time), highest(facets, points)
    np.testing.assert_allclose(found.z, expected.values, atol=1e-12)
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-9)
    there = ~np.isnan(found.z)
    assert 0 < there.sum() < 400
    np.testing.assert_allclose(found.velocities[there], 1.0, rtol=1e-6)
    np.testing.assert_allclose(found.ages[there], 0.05)
    origins, directions = rng.uniform((-1.0, -1.0, -3.0), (9.0, 12.0, 6.0), (150, 3)), rng.normal(size=(150, 3))
    hits, first = cast(mesh, origins, directions, 12.0, time), first_hit(facets, origins, directions, 12.0)
    np.testing.assert_allclose(hits.distances, first.values, atol=1e-9)
    np.testing.assert_allclose(hits.normals, first.normals, atol=1e-9)
    assert 10 < np.isfinite(hits.distances).sum() < 150
    assert (np.abs(hits.normals[:, 0]) == 1.0).any(), "the upright wall is met"


def test_ground_that_slides_and_turns_carries_its_points() -> None:
    heights = np.random.default_rng(1).normal(scale=0.1, size=(30, 40))
    heightmap = HeightMap(heights, resolution=0.1, origin=(1.0, 2.0), yaw=0.3)
    heightmap.slide((0.8, -0.3), 0.1, spin=0.5)
    time, step = 0.02, 1e-5
    points = heightmap.placed_at(time).to_world(*np.random.default_rng(1).uniform(3.0, 25.0, (2, 200)))
    now = at(heightmap, points, time)
    later = at(heightmap, points + step * now.velocities[:, :2], time + step)
    np.testing.assert_allclose(later.z, now.z, atol=1e-8)
    assert np.linalg.norm(now.velocities[:, :2], axis=1).max() > 0.5


def test_age_is_that_of_the_block() -> None:
    heightmap = rough_map(0)
    heightmap.update_region(0, 0, np.ones((3, 3)), time=0.5)
    points = heightmap.geometry.to_world(np.array([1.5, 30.5]), np.array([1.5, 65.5]))
    np.testing.assert_allclose(at(heightmap, points, 0.75).ages, [0.25, 0.75 - LAST])


@pytest.mark.parametrize("motion", [MotionConfig(), MotionConfig(changes="correction", settle=0.4)])
def test_a_ray_caster_follows_the_ground(motion: MotionConfig) -> None:
    """Kept heights are those of the instant: the ground moves or is corrected, rests, and gets other maps."""
    heightmap = rough_map(1, motion=motion)
    heightmap.show(LAST)
    heightmap.replace(heightmap.heights + 0.1, time=LAST)
    caster = RayCaster(Terrain(heightmap))
    origins, directions = rays_at(heightmap, 40, 2)
    rays, before = checked_rays(origins, directions, 20.0), np.zeros(40)
    for time in (0.06, 0.07, 5.0, 6.0, 7.0):
        heightmap.show(time)
        found = caster.cast(rays, time).distances
        np.testing.assert_allclose(found, first_hit(triangles_of(heightmap, time), origins, directions, 20.0).values)
        assert np.array_equal(found, before) == (time == 6.0)
        before = found
        if time == 6.0:
            heightmap.update_region(3, 3, np.full((20, 20), 2.0), time=time)


def test_no_ray_slips_through_edges_and_corners() -> None:
    """Rays through every vertex and every middle of an edge, straight down and slanted."""
    heightmap = rough_map(4)
    r, c = (0.5 * part.reshape(-1) for part in np.mgrid[8:72, 8:132])
    on_ground = heightmap.geometry.to_world(r, c)
    for way in (DOWN, np.array([0.3, 0.3, -3.0]), np.array([0.5, 0.0, -3.0])):
        length = np.linalg.norm(way)
        origins = np.column_stack([on_ground, np.zeros(len(r))]) + 6.0 * way / way[2]
        distances = cast(heightmap, origins, np.tile(way, (len(r), 1)), 1000.0, 10.0).distances
        assert np.isfinite(distances).all()
        z = heightmap.at((origins + distances[:, None] * way / length)[:, :2], 10.0).heights
        np.testing.assert_allclose(origins[:, 2] + distances * way[2] / length, z, atol=1e-6)


def test_an_edge_of_a_whole_facet_is_ground_beside_a_hole() -> None:
    heights = np.ones((5, 5))
    heights[2, 3] = np.nan
    heightmap = HeightMap(heights, resolution=1.0)
    #         on an edge of facets on its left only; inside the hole; on the hole's corner
    points = np.array([[2.0, 2.5], [2.5, 2.2], [3.0, 2.0], [2.0, 2.0], [4.0, 4.0]])
    np.testing.assert_array_equal(np.isnan(at(heightmap, points, 0.0).z), [False, True, True, False, False])


def test_without_ground_all_is_nan() -> None:
    found = at(Terrain(), np.zeros((3, 2)), 0.0)
    assert all(np.isnan(values).all() for values in found)
    assert found.normals.shape == (3, 3)


@pytest.mark.parametrize("gap", [0, 1])
def test_tiles_are_one_surface(gap: int) -> None:
    """A map, and the same one as two tiles; with ``gap`` 1 they share no samples."""
    heights = np.random.default_rng(2).normal(scale=0.2, size=(20, 40))
    first, whole = 19 + gap, HeightMap(heights, resolution=0.2)
    right = HeightMap(heights[:, first:], resolution=0.2, origin=(0.2 * first, 0.0))
    terrain = terrain_of(left=HeightMap(heights[:, :20], resolution=0.2), right=right)
    points = points_on(whole, 400, beyond=0.0)
    points[:100, 0] = np.linspace(3.75, 4.05, 100)  # about the seam
    one, two = at(whole, points, 0.0), at(terrain, points, 0.0)
    for expected, found in zip(one, two, strict=True):
        np.testing.assert_allclose(found, expected, atol=2e-6)
    np.testing.assert_array_equal(np.isnan(two.z), np.isnan(one.z))


def test_the_padding_of_a_coarse_tile_does_not_cover_its_fine_neighbour() -> None:
    terrain = Terrain(HeightMap(np.zeros((6, 6)), resolution=1.0))
    bumps = np.zeros((51, 51))
    bumps[:, 5] = 0.5  # between the samples of the coarse tile's lattice
    terrain.put("fine", HeightMap(bumps, resolution=0.1, origin=(5.0, 0.0)))
    hits = cast(terrain, [[5.5, 2.5, 2.0], [5.25, 2.5, 2.0]], [DOWN] * 2, 5.0)
    np.testing.assert_allclose(hits.distances, [1.5, 2.0])


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
    """Return the heights (N,) [m] that samples, queries and rays straight down find."""
    above = np.column_stack([points, np.full(len(points), 5.0)])
    rays = cast(terrain, above, np.tile(DOWN, (len(points), 1)), 10.0, time)
    return {
        "samples": terrain.at(points, time).heights,
        "queries": at(terrain, points, time).z,
        "rays": 5.0 - rays.distances,
    }


RESOLUTIONS = ((0.5, 0.5), (0.5, 0.1), (0.1, 0.5), (0.5, 0.03))


@pytest.mark.parametrize("gap", (0.05, 0.35, 0.5))
@pytest.mark.parametrize(("first", "second"), RESOLUTIONS)
@pytest.mark.parametrize("shift", (0.0, 0.123))
def test_all_find_the_same_height(first: float, second: float, gap: float, shift: float) -> None:
    terrain, points = two_tiles(first, second, gap, 1, shift), in_gap(gap, 2)
    for time in (0.05, 0.06):
        found = heights_of(terrain, points, time)
        assert np.isfinite(found["samples"]).all()
        np.testing.assert_array_equal(found["queries"], found["samples"])
        np.testing.assert_allclose(found["rays"], found["samples"], atol=1e-9)


@pytest.mark.parametrize(("first", "second"), RESOLUTIONS[:3])
def test_a_bridge_meets_the_edge_of_the_finer_tile_and_is_a_plane_between_level_tiles(
    first: float, second: float
) -> None:
    terrain, points, y = two_tiles(first, second, 0.5, 3), in_gap(0.5, 4), np.linspace(1.0, 9.0, COUNT)
    edge, inwards = (0.0, 1.0) if first <= second else (0.5, -1.0)
    on, beside = (
        terrain.at(np.column_stack([np.full(COUNT, x), y]), 0.05).heights for x in (edge, edge + 1e-5 * inwards)
    )
    np.testing.assert_allclose(beside, on, atol=1e-3)
    for name, level in (("a", 0.0), ("b", 1.0)):
        tile = terrain.tiles[name]
        tile.replace(np.full((tile.geometry.rows, tile.geometry.columns), level), time=1.0)
    np.testing.assert_allclose(terrain.at(points, 9.0).heights, points[:, 0] / 0.5, atol=1e-9)


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
