"""Rays onto bodies and ground together."""

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, InputError, Sphere, World
from smartmesh_ros.world.body_rays import GROUND, NOTHING
from tests.urdfs import ROVER

# How early PyBullet's rays may stop at a curved surface [m].
EARLY = 2e-3


def names_of(world: World, origins: list[list[float]], directions: list[list[float]], **options: object) -> list[str]:
    hits = world.cast_rays(origins, directions, 10.0, **options)  # type: ignore[arg-type]
    return [hits.names[hit] if hit >= 0 else "" for hit in hits.hits]


@pytest.mark.parametrize("count", [1, 8, 9, 60])
def test_balls_hide_the_ground_as_geometry_says(world: World, count: int) -> None:
    """Also of many balls, of which a ray is compared with few."""
    rng, radius = np.random.default_rng(count), 0.6 / count ** (1 / 3)
    centres = rng.uniform((-2.0, -2.0, 0.3), (2.0, 2.0, 2.0), (count, 3))
    directions = rng.normal(size=(2000, 3)) * (1.0, 1.0, 0.5)
    directions[::5, rng.integers(3)] = 0.0  # along a plane of the axes
    origins = rng.uniform(-3.0, 3.0, (2000, 3)) * (1.0, 1.0, 0.2) + (0.0, 0.0, 1.5)
    for number, centre in enumerate(centres.tolist()):
        world.spawn(f"ball_{number}", Sphere(radius), 1.0, BodyState((3.0, 3.0, radius)))
        world.move(f"ball_{number}", BodyState(tuple(centre)))
    found = world.cast_rays(origins, directions, 5.0)
    ways = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    to_centre = centres - origins[:, None]
    along, away = np.einsum("rbi,ri->rb", to_centre, ways), np.linalg.norm(to_centre, axis=2)
    inner = radius**2 - away**2 + along**2
    meets = (inner > 0.0) & (away > radius) & (along > 0.0)
    balls = np.where(meets, along - np.sqrt(np.maximum(inner, 0.0)), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = -origins[:, 2] / ways[:, 2]
        hit = origins + flat[:, None] * ways
    flat[~(flat > 0.0) | (np.abs(hit[:, :2]) > 5.0).any(axis=1)] = np.inf
    expected = np.minimum(balls.min(axis=1), flat)
    expected[expected > 5.0] = np.inf
    clear = (np.abs(inner) > 0.01 * radius).all(axis=1)  # not grazing
    assert clear.mean() > 0.5
    ball = np.where(balls.min(axis=1) < flat, 1 + balls.argmin(axis=1), GROUND)
    assert (found.hits[clear] == np.where(expected == np.inf, NOTHING, ball)[clear]).all()
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
    for one in ("rover", (name for name in ["rover"])):
        assert names_of(world, [above], [down], through=one) == ["ground"]
    for nobody in ("nobody", ["nobody"], 5, None):
        with pytest.raises(InputError, match="there is no body"):
            world.cast_rays([above], [down], 1.0, through=nobody)  # type: ignore[arg-type]
