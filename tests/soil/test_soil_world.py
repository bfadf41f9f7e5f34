"""Soil in a PyBullet world: what falls, slides and leaves."""

import math
from itertools import islice

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, Material, Soil, Sphere, World
from smartmesh_ros.ground.shapes import Shape

FLAT = np.zeros((101, 101))


def laid(world: World, name: str) -> Soil:
    world.ground.set_soil(soil := Soil(world.terrain, name))
    return soil


@pytest.mark.parametrize("shape", [Box(0.3, 0.3, 0.3), Sphere(0.15), Cylinder(radius=0.15, height=0.2)])
def test_a_heavy_body_dropped_from_a_metre_is_neither_lost_nor_thrown(shape: Shape) -> None:
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("heavy", shape, 40.0, BodyState((2.0, 2.0, 1.15)))
        soil, heights = laid(world, "lunar"), []
        for _ in range(960):
            world.step()
            heights.append(world.state("heavy").position[2])
        assert max(islice(heights, int(np.argmax(np.array(heights) < 0.2)), None)) < 0.25
        assert max(heights[200:]) - min(heights) < 1e-3
        assert 0.0 < soil.sinkage().max() < 0.2
        assert world.rescues == 0


def test_a_sliding_box_is_held_by_the_shear_strength() -> None:
    """On a slope below the angle of friction a box creeps by millimetres and stays; above, it slides."""
    x = np.tile(0.04 * np.arange(101), (101, 1))
    for degrees in (15.0, 45.0):
        with World(HeightMap(-math.tan(math.radians(degrees)) * x, resolution=0.04)) as world:
            world.spawn("box", Box(0.2, 0.2, 0.1), 20.0, BodyState((2.0, 2.0, 0.0)), on_ground=True, align=True)
            laid(world, "dry_sand")
            places = [2.0]
            for seconds in (1.0, 0.5, 0.5):
                world.step(round(seconds / world.dt))
                places.append(world.state("box").position[0])
        first, more, last = np.diff(places)
        if degrees > 30.0:
            assert more + last > 0.3
        else:
            assert 0.0 < first < 0.03
            assert more + last < 1e-4


def test_what_sleeps_on_hard_soil_sinks_when_soft_soil_lies_there() -> None:
    """By an assignment to the map, and by a map that scrolled: its soils stay with the ground. Kinds that are not there
    count as the last, also in a saved state, and a map that says none has the first."""
    for scrolls, kind in ((False, 200), (True, 1)):
        with World(HeightMap(FLAT, resolution=0.04)) as world:
            world.spawn("box", Box(0.2, 0.2, 0.2), 20.0, BodyState((2.0, 2.0, 0.1)))
            world.ground.set_soil(Soil(world.terrain, ["lunar", "clay"]))
            world.terrain.tile("").soil = np.full((101, 101), kind)
            world.step(480)
            assert world.is_asleep("box")
            assert world.state("box").position[2] == pytest.approx(0.1, abs=1e-3)
            world.restore(world.save())
            if scrolls:
                world.terrain.put("", HeightMap(FLAT, resolution=0.04, origin=(0.4, 0.0), time=world.time))
                world.ground.set_soil(Soil(world.terrain, ["lunar", "clay"]))
                world.step(240)
                assert world.state("box").position[2] == pytest.approx(0.1, abs=1e-3)
            kinds = Material(soil=np.zeros((101, 101), np.uint8))
            world.terrain.tiles[""].material = kinds if scrolls else Material()  # type: ignore[union-attr]
            world.step(240)
            assert world.state("box").position[2] < 0.096


@pytest.mark.parametrize("samples", [1, 4, 5])
def test_the_map_is_lower_by_the_sinkage_of_its_samples(samples: int) -> None:
    """Also of those at the edge of a print, and where fine samples lie in the middle between two of the map."""
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.ground.set_soil(soil := Soil(world.terrain, "lunar", spacing=0.04 / samples))
        world.spawn("ball", Sphere(0.15), 20.0, BodyState((2.003, 1.987, 0.15), linear=(0.4, 0.3, 0.0)))
        world.step(240)
        soil.show()
        assert soil.sinkage().max() > 0.01
        np.testing.assert_allclose(soil.map.heights, -soil.sinkage(), atol=1e-6)


@pytest.mark.parametrize("shape", [Box(0.2, 0.2, 0.2), Sphere(0.1), Cylinder(radius=0.1, height=0.2)])
def test_a_map_that_is_higher_at_once_lifts_what_stands_in_its_soil(shape: Shape) -> None:
    """Without a velocity, as after a long break: what stands there is below the new ground, and its print goes along."""
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("body", shape, 10.0, BodyState((2.0, 2.0, 0.1)))
        laid(world, "dry_sand")
        world.step(240)
        before = world.state("body").position[2]
        world.terrain.tile("").replace(FLAT + 0.3, time=world.time + 100.0)
        heights = []
        for _ in range(240):
            world.step()
            heights.append(world.state("body").position[2] - 0.3)
        assert max(heights) < 0.12
        assert before - 0.02 < heights[-1] <= before + 1e-3
