"""The laws of moving ground, and that each mechanism is what makes them hold."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, HeightMap, PatchConfig, Sphere, World, WorldConfig
from smartmesh_ros.patches.config import PatchKind

GRAVITY = 9.81


def flat(size: int = 121, resolution: float = 0.1) -> HeightMap:
    half = 0.5 * (size - 1) * resolution
    return HeightMap(np.zeros((size, size)), resolution=resolution, origin=(-half, -half))


@pytest.mark.parametrize("make", [lambda: Sphere(0.25), lambda: Box(0.4, 0.3, 0.5)], ids=["sphere", "box"])
def test_a_body_that_falls_obeys_ballistics_until_it_rests(make: Callable[[], Sphere | Box]) -> None:
    shape = make()
    low = 0.25
    with World(flat(61)) as world:
        world.spawn("body", shape, 2.0, BodyState((0.0, 0.0, 1.25)))
        world.step(72)
        fallen = 0.3
        # Symplectic Euler falls g dt t / 2 further than the parabola.
        expected = 1.25 - 0.5 * GRAVITY * fallen**2 - 0.5 * GRAVITY * fallen / 240.0
        assert world.state("body").position[2] == pytest.approx(expected, abs=1e-6)
        world.step(240)
        assert world.state("body").position[2] == pytest.approx(low, abs=1e-3)
        force = sum(contact.normal_force for contact in world.contacts())
        assert force == pytest.approx(2.0 * GRAVITY, rel=0.01)


@pytest.mark.parametrize("rate", [0.0, 60.0])
@pytest.mark.parametrize("kind", ["heightfield", "auto"])
def test_a_ball_stays_on_a_seesaw_however_steep(kind: PatchKind, rate: float) -> None:
    """Ground rises and falls where it is; a collider that turns about a point aside would move into the ball."""
    across = 0.5 * (np.indices((41, 41))[1] - 20)
    with World(
        heightmap := HeightMap(0.0 * across, resolution=0.5, origin=(-10.0, -10.0, 0.0)),
        WorldConfig(patch=PatchConfig(kind=kind, rate=rate)),
    ) as world:
        world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.22, 0.2, 0.2)))
        for step in range(100):
            if step:
                heightmap.replace(0.8 * math.sin(3.0 * world.time) * across, time=world.time)
            world.step()
            slope, (x, _, z) = 0.8 * math.sin(3.0 * world.time), world.state("ball").position
            clearance = (z - slope * x) / math.hypot(1.0, slope) - 0.2
            assert step < 5 or abs(clearance) < 5e-4  # the ground's velocity is known after two maps
