"""A point in a gap between height maps has one height, whoever asks."""

from __future__ import annotations

import numpy as np
import pytest

from smartmesh_ros import BodyState, HeightMap, PhysicsConfig, Sphere, Terrain, World, WorldConfig
from smartmesh_ros.terrain.surface_query import RayCaster, checked_points, checked_rays, ground_samples

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
    with World(terrain, WorldConfig(physics=PhysicsConfig(guard=False))) as world:
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
