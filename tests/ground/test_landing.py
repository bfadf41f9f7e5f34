"""Bodies meet ground that starts, accelerates and ends at its surface, and the guard catches what got below it."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, Sphere, World
from smartmesh_ros.ground.shapes import Shape
from tests.bodies import about_y
from tests.grounds import shaped, world_of
from tests.urdfs import joint, link, robot

DT, SIDE = 1.0 / 240.0, 41


BARBELL = robot(
    link("near", moment=0.1), link("far", '<sphere radius="0.2"/>', moment=0.1),
    joint("rod", "fixed", "near", "far", xyz="1 0 0"),
)  # fmt: skip


@pytest.mark.parametrize("heights", [(0.0, 0.8), (0.8, 0.0)])
def test_the_guard_puts_back_a_robot_with_all_its_links(heights: tuple[float, float]) -> None:
    """Slowed. Two links in ground of two heights: both are out of it at once, and the robot counts as one."""
    with World(shaped(lambda x, y: np.where(x < 0.0, *heights), 51)) as world:
        world.spawn_robot("barbell", BARBELL, BodyState((-0.5, 0.0, -0.05), linear=(30.0, 0.0, 0.0)))
        world.spawn("fine", Sphere(0.2), 1.0, BodyState((1.0, 1.0, 1.2)))
        world.update()
        assert world.rescues == 1
        assert math.hypot(*world.state("barbell").linear) <= 5.1
        assert world.below_ground() == []
        lift = world.state("barbell").position[2] + 0.05
        assert lift == pytest.approx(0.85 + (0.1 if heights[0] else 0.2), abs=0.02)


def test_the_guard_leaves_who_crosses_a_ridge_and_finds_at_once_who_is_below_it() -> None:
    with World(shaped(lambda x, y: -np.abs(y), 21, 2.0)) as world:
        world.spawn("ball", Sphere(0.5), 1.0, BodyState((0.0, -0.5, 0.6)))
        uid = world.bodies["ball"].uid
        for y in np.linspace(-0.5, 0.8, 200):  # over the ridge, and below the plane that was up to then under it
            world.client.resetBasePositionAndOrientation(uid, (0.0, y, 0.55 - abs(y)), (0, 0, 0, 1))
            world.update()
        assert world.rescues == 0
        world.client.resetBasePositionAndOrientation(uid, (0.0, 0.8, -0.9), (0, 0, 0, 1))
        world.update()
        assert world.rescues == 1


def lying(slope: float) -> BodyState:
    """A cylinder that is 0.1 m high, just above a slope."""
    angle = math.atan(slope)
    return BodyState((-0.0501 * math.sin(angle), 0.0, 0.0501 * math.cos(angle)), about_y(-angle))


BOX, CYLINDER = Box(0.3, 0.3, 0.3), Cylinder(radius=0.15, height=0.1)
ROUGH = np.random.default_rng(3).normal(scale=0.02, size=(SIDE, SIDE))
SLOPE = np.tile(0.3 * (0.1 * np.arange(SIDE) - 2.0), (SIDE, 1))
ON_ROUGH = BodyState((0.0, 0.0, float(ROUGH.max()) + 0.15))


@pytest.mark.parametrize(
    ("shape", "start", "heights", "speed", "lowest"),
    [
        (BOX, BodyState((0.0, 0.0, 0.15)), 0.0 * ROUGH, 1.0, -1e-4),
        (BOX, BodyState((0.0, 0.0, 0.15)), 0.0 * ROUGH, 5.0, -1e-4),
        (BOX, ON_ROUGH, ROUGH, 2.0, -0.01),
        (BOX, ON_ROUGH, ROUGH, 5.0, -0.01),
        (CYLINDER, lying(0.0), 0.0 * ROUGH, 1.5, -1e-3),
        (CYLINDER, lying(0.3), SLOPE, 1.5, -1e-3),
    ],
)
def test_a_body_at_rest_rides_on_ground_that_starts_to_rise_at_once(
    shape: Shape, start: BodyState, heights: np.ndarray, speed: float, lowest: float
) -> None:
    """And is not thrown: at most 1 mm above where it would ride, in each step of a second."""
    still = np.zeros((SIDE, SIDE))
    heightmap = HeightMap(heights, resolution=0.1, origin=(-2.0, -2.0), velocities=still)
    # After sleep, contacts of a cylinder take some steps to form anew.
    with world_of(heightmap, sleep=shape is BOX) as world:
        world.spawn("body", shape, 1.0, start)
        world.step(240)
        rest, found = world.state("body").position[2], []
        for step in range(240):
            if step % 4 == 0:
                heightmap.replace(heights + speed * step * DT, time=1.0 + step * DT, velocities=still + speed)
            world.step()
            found.append(world.state("body").position[2] - rest - speed * (step + 1) * DT)
        assert max(found) <= 1e-3
        assert min(found) >= lowest
