"""Cylinders stand still and roll straight on level ground."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Cylinder, HeightMap, PatchConfig, World, WorldConfig
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchKind

LYING = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # with its axis along y
RATE = 240


def level() -> HeightMap:
    return HeightMap(np.zeros((41, 41)), resolution=0.1, origin=(-2.0, -2.0))


@pytest.mark.parametrize(
    ("kind", "height", "drop", "speed", "turn"),
    [
        *(("auto", height, drop, 1e-4, 1e-3) for height, drop in ((0.3, 0.25), (0.3, 0.002), (0.05, 0.25))),
        *((kind, 0.3, 0.25, 5e-3, 5e-2) for kind in ("trimesh", "prisms")),
    ],
)
def test_a_standing_cylinder_comes_to_rest(
    kind: PatchKind, height: float, drop: float, speed: float, turn: float
) -> None:
    """Within 2 s of being dropped; on a collider of triangles it hardly moves."""
    with World(level(), WorldConfig(patch=PatchConfig(kind=kind))) as world:
        world.spawn("can", Cylinder(0.15, height), 1.0, BodyState((0.0, 0.0, drop + 0.5 * height)))
        world.step(2 * RATE)
        for _ in range(2 * RATE):
            world.step()
            state = world.state("can")
            assert math.hypot(*state.linear) < speed
            assert math.hypot(*state.angular) < turn


def test_a_cylinder_rolls_straight() -> None:
    """40 m on level ground."""
    with World(HeightMap(np.zeros((21, 201)), resolution=0.25, origin=(-2.0, -2.5))) as world:
        speed, radius = 2.0, 0.15
        state = BodyState((0.0, 0.0, radius), LYING, (speed, 0.0, 0.0), (0.0, speed / radius, 0.0))
        world.spawn("roller", Cylinder(radius, 0.3), 1.0, state)
        world.step(20 * RATE)
        end = world.state("roller")
        assert end.position[0] > 39.0
        assert abs(end.position[1]) < 5e-3
        assert end.linear[0] == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_cylinder_rides_on_a_plane_that_rises(slope: float) -> None:
    speed, angle = 1.5, math.atan(slope)
    plane = np.tile(slope * (0.1 * np.arange(41) - 2.0), (41, 1))
    heightmap = HeightMap(plane, resolution=0.1, origin=(-2.0, -2.0), velocities=np.zeros((41, 41)))
    turn = (0.0, -math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle))
    axis = np.array([-math.sin(angle), 0.0, math.cos(angle)])
    awake = WorldConfig(physics=PhysicsConfig(sleep=False))  # its contacts take some steps to form anew after sleep
    with World(heightmap, awake) as world:
        world.spawn("can", Cylinder(0.15, 0.1), 1.0, BodyState(tuple((0.0501 * axis).tolist()), turn))
        heights = []
        for step in range(2 * RATE):
            if step >= RATE and step % 4 == 0:
                rise = speed * (step - RATE) / RATE
                heightmap.replace(plane + rise, time=world.time, velocities=np.full((41, 41), speed))
            world.step()
            x, _, z = world.state("can").position
            ground = slope * x + speed * max(0.0, world.time - 1.0)
            heights.append((z - ground) * math.cos(angle) - 0.05)
        assert max(heights) < 1e-3
        assert min(heights) > -1e-3
