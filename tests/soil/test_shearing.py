"""Soil that is sheared one way, and then another."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape
from smartmesh_ros.soil.config import soil_named
from tests.soil.test_soil_world import world_on

MASS = 20.0  # [kg]
STRENGTH = math.tan(math.radians(28.0))  # of dry sand, but for its cohesion


@pytest.mark.parametrize("shape", [Box(0.2, 0.2, 0.04), Cylinder(radius=0.1, height=0.04)])
def test_what_slides_back_over_its_start_is_held_by_the_whole_strength(shape: Shape) -> None:
    """Janosi and Hanamoto's stress turns round within a few shear moduli, wherever the body was when it did."""
    soil = soil_named("dry_sand")
    with world_on("dry_sand", sleep=False) as world:
        world.spawn("body", shape, MASS, BodyState((2.003, 2.007, 0.0)), on_ground=True)
        world.step(120)
        strength = soil.Mohr_cohesion * world.ground.on_soil()["body"].area / MASS + 9.81 * STRENGTH
        world.client.resetBaseVelocity(world.body("body").uid, (1.3, 0.0, 0.0))
        world.step(120)
        start = world.state("body").position[0]
        world.client.resetBaseVelocity(world.body("body").uid, (-2.0, 0.0, 0.0))
        ways, speeds = [], []
        for _ in range(48):
            world.step()
            ways.append(start - world.state("body").position[0])
            speeds.append(-world.state("body").linear[0])
    slowing = -np.diff(speeds) / world.dt
    turned = (np.array(ways[:-1]) > 6.0 * soil.Janosi_shear) & (np.array(speeds[1:]) > 0.1)
    assert max(np.array(ways)[:-1][turned]) > 0.2  # it started at 0.14
    assert slowing[turned] == pytest.approx(strength, rel=0.08)
