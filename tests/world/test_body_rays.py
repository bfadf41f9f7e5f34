"""Rays onto bodies and ground together."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, InputError, Sphere, World
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
    world.spawn("ball", Sphere(radius), 1.0, BodyState((0.4, -0.3, 0.9)))
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


def test_colliders_of_the_ground_are_not_met() -> None:
    """Bodies at rest have planes and fields under them, which must not count as bodies."""
    r, c = np.mgrid[:101, :101]
    hills = 0.2 * np.sin(0.09 * r) * np.cos(0.07 * c)
    with World(HeightMap(hills, resolution=0.1, origin=(-5.0, -5.0))) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 0.0)), on_ground=True)
        world.spawn("box", Box(0.4, 0.4, 0.4), 1.0, BodyState((1.0, 1.0, 0.0)), on_ground=True)
        world.track("dictated", 0.3, BodyState((-1.0, 1.0, 0.5)))
        world.step(120)
        x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-2.0, 2.0, 60), np.linspace(-2.0, 2.0, 60)))
        down = np.tile([0.0, 0.0, -1.0], (len(x), 1))
        found = world.cast_rays(np.column_stack([x, y, np.full(len(x), 3.0)]), down, 10.0)
        on_ground = found.hits == GROUND
        np.testing.assert_allclose(
            3.0 - found.distances[on_ground], world.ground_at(np.column_stack([x, y])[on_ground]).z, atol=1e-9
        )
        for name in ("ball", "box", "dictated"):
            position = world.state(name).position
            covered = np.hypot(x - position[0], y - position[1])[found.hits == found.names.index(name)]
            assert len(covered) > 20 and covered.max() < 0.4


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


def test_a_body_that_was_moved_is_met_where_it_is(world: World) -> None:
    world.spawn("ball", Sphere(0.5), 1.0, BodyState((0.0, 0.0, 1.0)))
    world.move("ball", BodyState((2.0, 0.0, 1.0)))
    assert names_of(world, [[0, 0, 3], [2, 0, 3], [4, 0, 3]], [[0, 0, -1]] * 3) == ["ground", "ball", "ground"]
    assert math.isinf(world.cast_rays([[0, 0, 3]], [[0, 0, 1]], 10.0).distances[0])


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
