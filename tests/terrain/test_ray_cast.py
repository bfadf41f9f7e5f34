"""Rays onto the ground, against all facets of the main mesh by brute force."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmesh_ros import HeightMap, InputError, MotionConfig, Terrain
from smartmesh_ros.terrain.surface_query import GroundHits, RayCaster, checked_rays
from smartmesh_ros.terrain.trimesh import TriangleMesh
from tests.terrain.surfaces import first_hit, triangles_of
from tests.terrain.test_surface_query import folded_mesh

TILE = 16  # cells along the side of the tiles that rays traverse
ROWS, COLUMNS, RESOLUTION = 2 * TILE + 5, 3 * TILE + 1, 0.5


def rough_map(seed: int, holes: int = 0, yaw: float = 0.0) -> HeightMap:
    """Hills with holes, which move."""
    rng = np.random.default_rng(seed)
    heights = np.cumsum(rng.normal(scale=0.15, size=(ROWS, COLUMNS)), axis=1)
    heights.ravel()[rng.integers(0, heights.size, holes)] = np.nan
    heightmap = HeightMap(heights, resolution=RESOLUTION, origin=(-4.0, 3.0, 1.0), yaw=yaw)
    for number in range(1, 4):
        heightmap.replace(heights + 0.1 * number * rng.normal(size=heights.shape), time=0.02 * number)
    return heightmap


def rays_at(heightmap: HeightMap, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from above, below and beside a map, most of them flat; some straight down."""
    rng, geometry = np.random.default_rng(seed), heightmap.geometry
    places = (rng.uniform(-5.0, samples + 4.0, count) for samples in (geometry.rows, geometry.columns))
    origins = np.column_stack([geometry.to_world(*places), rng.uniform(-2.0, 4.0, count)])
    directions = rng.normal(size=(count, 3)) * (1.0, 1.0, 0.2)
    directions[::7] = (0.0, 0.0, -1.0)
    directions[1::7, 0] = 0.0
    return origins, directions


def cast(ground: Any, origins: np.ndarray, directions: np.ndarray, reach: float, time: float = 0.0) -> GroundHits:
    return RayCaster(Terrain.of(ground)).cast(checked_rays(origins, directions, reach), time)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), holes=st.sampled_from([0, 200]), yaw=st.sampled_from([0.0, 0.7, -2.0]))
def test_rays_meet_the_first_facet(seed: int, holes: int, yaw: float) -> None:
    heightmap, time, reach = rough_map(seed, holes, yaw), 0.07, 15.0
    origins, directions = rays_at(heightmap, 60, seed)
    found = cast(heightmap, origins, directions, reach, time)
    expected = first_hit(triangles_of(heightmap, time), origins, directions, reach)
    np.testing.assert_allclose(found.distances, expected.values, atol=1e-8)
    np.testing.assert_allclose(found.normals, np.sign(expected.normals[:, 2:]) * expected.normals, atol=1e-8)


def test_a_ray_caster_follows_the_ground() -> None:
    """Kept heights are those of the instant: the ground moves on, rests, and gets other maps."""
    heightmap = rough_map(1)
    caster = RayCaster(Terrain(heightmap))
    origins, directions = rays_at(heightmap, 40, 2)
    rays = checked_rays(origins, directions, 20.0)
    before = np.zeros(40)
    for time in (0.06, 0.07, 5.0, 6.0):
        found = caster.cast(rays, time).distances
        np.testing.assert_allclose(found, first_hit(triangles_of(heightmap, time), origins, directions, 20.0).values)
        assert np.array_equal(found, before) == (time == 6.0)
        before = found
    heightmap.update_region(3, 3, np.full((20, 20), 2.0), time=6.0)
    after = caster.cast(rays, 6.0).distances
    np.testing.assert_array_equal(after, cast(heightmap, origins, directions, 20.0, 6.0).distances)
    assert not np.array_equal(after, before)


def test_no_ray_slips_through_edges_and_corners() -> None:
    """Rays through every vertex and every middle of an edge, straight down and slanted."""
    heightmap = rough_map(4)
    r, c = (0.5 * part.reshape(-1) for part in np.mgrid[8 : 2 * ROWS - 9, 8 : 2 * COLUMNS - 9])
    on_ground = heightmap.geometry.to_world(r, c)
    for way in ([0.0, 0.0, -1.0], [0.3, 0.3, -3.0], [0.5, 0.0, -3.0]):
        length = np.linalg.norm(way)
        origins = np.column_stack([on_ground, np.zeros(len(r))]) + 6.0 * np.array(way) / way[2]
        distances = cast(heightmap, origins, np.tile(way, (len(r), 1)), 1000.0, 10.0).distances
        assert np.isfinite(distances).all()
        z = heightmap.at((origins + distances[:, None] * np.array(way) / length)[:, :2], 10.0).heights
        np.testing.assert_allclose(origins[:, 2] + distances * way[2] / length, z, atol=1e-6)


def test_the_padding_of_a_coarse_tile_does_not_cover_its_fine_neighbour() -> None:
    terrain = Terrain(HeightMap(np.zeros((6, 6)), resolution=1.0))
    bumps = np.zeros((51, 51))
    bumps[:, 5] = 0.5  # between the samples of the coarse tile's lattice
    terrain.put("fine", HeightMap(bumps, resolution=0.1, origin=(5.0, 0.0)))
    hits = cast(terrain, np.array([[5.5, 2.5, 2.0], [5.25, 2.5, 2.0]]), np.array([[0.0, 0.0, -1.0]] * 2), 5.0)
    np.testing.assert_allclose(hits.distances, [1.5, 2.0])


def test_a_correction_counts_as_far_as_it_is_worked_off() -> None:
    heightmap = HeightMap(np.zeros((20, 20)), resolution=1.0, motion=MotionConfig(changes="correction", settle=0.4))
    heightmap.show(1.0)
    heightmap.replace(np.ones((20, 20)), time=1.0)
    caster, down = RayCaster(Terrain(heightmap)), checked_rays([[5.2, 7.1, 3.0]], [[0.0, 0.0, -2.0]], 10.0)
    for shown, distance in ((1.0, 3.0), (1.1, 2.75), (1.3, 2.25), (1.4, 2.0), (9.0, 2.0)):
        heightmap.show(shown)
        np.testing.assert_allclose(caster.cast(down, shown).distances, distance, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_rays_onto_a_general_mesh(seed: int) -> None:
    mesh = folded_mesh(seed)
    mesh.move(mesh.vertices + 0.1, time=0.1)
    time, rng = 0.15, np.random.default_rng(seed)
    origins, directions = rng.uniform((-1.0, -1.0, -3.0), (9.0, 12.0, 6.0), (150, 3)), rng.normal(size=(150, 3))
    moved = mesh.sample(np.arange(mesh.size), time).positions[mesh.triangles]
    expected = first_hit(moved, origins, directions, 12.0)
    found = cast(mesh, origins, directions, 12.0, time)
    np.testing.assert_allclose(found.distances, expected.values, atol=1e-9)
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-9)
    assert 10 < np.isfinite(found.distances).sum() < 150


def test_an_upright_wall_of_a_mesh_is_met() -> None:
    wall = TriangleMesh([[2, -1, 0], [2, 1, 0], [2, 1, 2], [2, -1, 2]], [[0, 1, 2], [0, 2, 3]])
    hit = cast(wall, np.array([[0.0, 0.0, 1.0]]), np.array([[3.0, 0.0, 0.0]]), 5.0)
    np.testing.assert_allclose(hit.distances, 2.0)
    np.testing.assert_allclose(np.abs(hit.normals), [[1.0, 0.0, 0.0]])


@pytest.mark.parametrize("length", [1e-300, 1e200])
def test_directions_may_have_any_length(length: float) -> None:
    level = HeightMap(np.zeros((20, 20)), resolution=1.0)
    hit = cast(level, np.array([[5.2, 7.1, 3.0]]), np.array([[0.0, 0.6 * length, -0.8 * length]]), 10.0)
    np.testing.assert_allclose(hit.distances, 3.75)


@pytest.mark.parametrize(
    ("origins", "directions", "reach", "words"),
    [
        ([[0, 0, 1]], [[0, 0, -1], [0, 0, 1]], 1.0, "both must be"),
        ([[0, 0]], [[0, 0]], 1.0, "both must be"),
        ([[0, 0, math.nan]], [[0, 0, -1]], 1.0, "not finite"),
        ([[0, 0, 1]], [[0, math.inf, -1]], 1.0, "not finite"),
        ([[0, 0, 1]], [[0, 0, 0]], 1.0, "direction 0 has no length"),
        ([[0, 0, 1e300]], [[0, 0, 1]], 1.0, "up to 1e\\+300 m away"),
        ([[0, 0, 1]], [[0, 0, -1]], 0.0, "range"),
        ([[0, 0, 1]], [[0, 0, -1]], math.inf, "range"),
    ],
)
def test_bad_rays_are_refused(origins: Any, directions: Any, reach: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked_rays(origins, directions, reach)
