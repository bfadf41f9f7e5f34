"""Rays onto bodies and ground together."""

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, InputError, Sphere, World
from smartmesh_ros.core import CORE
from smartmesh_ros.world.body_rays import GROUND, NOTHING
from tests.urdfs import ROVER

# How early PyBullet's rays may stop at a curved surface [m].
EARLY = 2e-3


def names_of(world: World, origins: list[list[float]], directions: list[list[float]], **options: object) -> list[str]:
    hits = world.cast_rays(origins, directions, 10.0, **options)  # type: ignore[arg-type]
    return [hits.names[hit] if hit >= 0 else "" for hit in hits.hits]


def test_balls_hide_the_ground_as_geometry_says(world: World) -> None:
    rng, radius, centre = np.random.default_rng(0), 0.6, np.array([0.4, -0.3, 0.9])
    directions = rng.normal(size=(2000, 3)) * (1.0, 1.0, 0.5)
    origins = rng.uniform(-3.0, 3.0, (2000, 3)) * (1.0, 1.0, 0.2) + (0.0, 0.0, 1.5)
    world.spawn("ball", Sphere(radius), 1.0, BodyState((2.0, 2.0, radius)))
    world.step()
    world.move("ball", BodyState((0.4, -0.3, 0.9)))
    found = world.cast_rays(origins, directions, 5.0)
    ways = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    to_centre = centre - origins
    along = (to_centre * ways).sum(axis=1)
    inner = radius**2 - (to_centre**2).sum(axis=1) + along**2
    outside = np.linalg.norm(to_centre, axis=1) > radius
    ball = np.where((inner > 0.0) & outside & (along > 0.0), along - np.sqrt(np.maximum(inner, 0.0)), np.inf)
    flat = -origins[:, 2] / ways[:, 2]
    hit = origins + flat[:, None] * ways
    flat[(flat < 0.0) | (np.abs(hit[:, :2]) > 5.0).any(axis=1)] = np.inf
    expected = np.minimum(ball, flat)
    expected[expected > 5.0] = np.inf
    clear = np.abs(inner) > 0.01  # not grazing
    assert (found.hits[clear] == np.where(expected == np.inf, NOTHING, np.where(ball < flat, 1, GROUND))[clear]).all()
    np.testing.assert_allclose(found.distances[clear], expected[clear], atol=4 * EARLY)
    on_ground = found.hits == GROUND
    np.testing.assert_allclose(found.distances[on_ground], flat[on_ground], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found.normals[found.hits != NOTHING], axis=1), 1.0, atol=1e-6)


def test_rays_pass_through_the_bodies_named(world: World) -> None:
    world.spawn_robot("rover", ROVER, BodyState((0.0, 0.0, 0.0)), on_ground=True)
    world.spawn("wall", Box(0.1, 2.0, 2.0), 1.0, BodyState((2.0, 0.0, 1.0)))
    inside = list(world.state("rover").position)
    above = [0.0, 0.0, 3.0]
    ahead, down = [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]
    assert names_of(world, [above], [down]) == ["rover"]
    assert names_of(world, [above, inside], [down, ahead], through=["rover"]) == ["ground", "wall"]
    assert names_of(world, [above, inside], [down, ahead], through=["rover", "wall"]) == ["ground", ""]
    distances = world.cast_rays([inside], [ahead], 10.0, through=["rover"]).distances
    assert distances == pytest.approx(1.95 - inside[0], abs=1e-3)
    with pytest.raises(InputError, match="no body 'nobody'"):
        world.cast_rays([above], [down], 1.0, through=["nobody"])


@pytest.mark.parametrize("count", [1, 8, 9, 100])
def test_rays_are_sent_to_bodies_whose_bounds_they_pass_through(count: int) -> None:
    rng = np.random.default_rng(count)
    low = rng.uniform(-5.0, 5.0, (count, 3))
    bounds = np.hstack([low, low + rng.uniform(0.1, 1.0, (count, 3))])
    origins, ways = rng.uniform(-8.0, 8.0, (300, 3)), rng.normal(size=(300, 3))
    ways[::5, rng.integers(3)] = 0.0  # along a plane of the axes
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    reach = rng.uniform(0.5, 15.0, 300)
    found = CORE.may_meet(origins, ways, reach, bounds)
    with np.errstate(divide="ignore"):
        ends = np.sort((bounds.reshape(count, 2, 3)[None] - origins[:, None, None]) / ways[:, None, None], axis=2)
    enter, leave = ends[:, :, 0].max(axis=-1).clip(0.0), ends[:, :, 1].min(axis=-1)
    np.testing.assert_array_equal(found, (enter <= np.minimum(leave, reach[:, None])).any(axis=1))
    assert 0 < found.sum() < 300
