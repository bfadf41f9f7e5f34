"""Bodies on ground that moves between maps, and time that goes on without steps."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, Sphere, World
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles
from tests.core import mesh_parts

DT = 1.0 / 240.0
SIDE = 41
RISE = 0.3  # [m/s]
RADIUS = 0.15
STEPS_PER_MAP = 12


class Rising:
    """A ball on ground that rises steadily, with the same ``slope`` everywhere along y."""

    def __init__(self, slope: float = 0.0) -> None:
        self.slope = slope
        self._steps = 0
        self._map = HeightMap(self._heights(0.0), resolution=0.1)
        self.world = World(self._map)
        for _ in range(3 * STEPS_PER_MAP):  # by then the ground's velocity is known
            self.step()
        above = self.height(2.0) + RADIUS * math.hypot(1.0, slope)
        self.world.spawn("ball", Sphere(RADIUS), 1.0, BodyState((2.0, 2.0, above), linear=(0.0, 0.0, RISE)))

    def height(self, y: float) -> float:
        """Of the ground now [m]."""
        return RISE * self.world.time + self.slope * y

    def step(self) -> None:
        """One step, after the map that is due."""
        if self._steps % STEPS_PER_MAP == 0:
            self._map.replace(self._heights(self.world.time), time=self.world.time)
        self._steps += 1
        self.world.step()

    def _heights(self, time: float) -> np.ndarray:
        return RISE * time + self.slope * 0.1 * np.arange(SIDE)[:, None] * np.ones(SIDE)


def test_between_maps_the_ground_goes_on() -> None:
    """The ball stands on it, and PyBullet has the ground where it is, in every step."""
    ground = Rising()
    with ground.world as world:
        for _ in range(60):
            ground.step()
            _, y, z = world.state("ball").position
            assert z - RADIUS == pytest.approx(ground.height(y), abs=1e-4)
            follower = world.ground.followers[0]
            points = world.client.getClosestPoints(follower.body, follower.collider, 0.05)
            assert max(point[6][2] for point in points) == pytest.approx(ground.height(y), abs=1e-4)


def test_bodies_ride_on_the_ground_although_steps_are_skipped() -> None:
    skipped, ground = 3, Rising()
    with ground.world as world:
        for step in range(240):
            if step % 5 == 0:
                world.skip(skipped)
            ground.step()
            _, y, z = world.state("ball").position
            # By what the ground rose while the ball stood still, less what the solver made good since.
            assert z - RADIUS > ground.height(y) - RISE * skipped * DT - 5e-4


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
