"""Bodies on ground that moves between maps, and time that goes on without steps."""

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, Sphere, World
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.core import mesh_parts
from tests.grounds import level, moving

SIDE = 41


def test_bodies_ride_on_the_ground_although_steps_are_skipped() -> None:
    """By what the ground rises while the ball stands still, less what the solver makes good since."""
    skipped, rise, radius = 3, 0.3, 0.15
    with World(level()) as world:
        world.spawn("ball", Sphere(radius), 1.0, BodyState((0.0, 0.0, radius)))
        for step in moving(world, lambda time: rise * time, 276, every=12):
            if step >= 36:  # the velocity of the ground is known
                height = world.state("ball").position[2] - radius
                assert height > rise * (world.time - skipped * world.dt) - 5e-4
                world.skip(skipped if step % 5 == 0 else 0)
        assert world.time == pytest.approx((276 + 48 * skipped) * world.dt)


@pytest.mark.parametrize("speed", [3.0, 20.0])
@pytest.mark.parametrize("radius", [0.02, 0.2])
def test_fast_bodies_roll_as_high_as_they_started(radius: float, speed: float) -> None:
    heightmap = HeightMap(np.zeros((5, 101)), resolution=0.5)
    with World(heightmap) as world:
        rolling = BodyState((1.0, 1.0, radius), linear=(speed, 0.0, 0.0), angular=(0.0, speed / radius, 0.0))
        world.spawn("ball", Sphere(radius), 1.0, rolling)
        for _ in range(240):
            world.step()
            assert world.state("ball").position[2] == pytest.approx(radius, abs=2e-4)
        assert world.state("ball").linear == pytest.approx((speed, 0.0, 0.0), rel=0.01, abs=0.01)


def test_a_general_mesh_moves_under_bodies_in_every_direction() -> None:
    vertices = mesh_parts.sheet(10.0, 40, lambda x, y: 0.15 * (x * x + y * y))[0]
    mesh = TriangleMesh(vertices, grid_triangles(SIDE, SIDE))
    with World(mesh) as world:
        world.spawn("box", Box(0.6, 0.6, 0.3), 1.0, BodyState((0.0, 0.0, 0.25)))
        world.step(240)
        start = world.state("box").position
        for _ in range(240):
            world.step()
            mesh.move(vertices + (0.5 * (world.time - 1.0), 0.0, 0.2 * (world.time - 1.0)), time=world.time)
        x, _, z = world.state("box").position
        assert (x - start[0], z - start[2]) == (pytest.approx(0.5, abs=0.025), pytest.approx(0.2, abs=0.005))
        np.testing.assert_allclose(world.patches().table().motion[0, :3], [0.5, 0.0, 0.2], atol=1e-6)
