"""Soil in a PyBullet world: contacts give load and place."""

import math
from itertools import islice
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, Sphere, World
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.patches.shapes import ball
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.contact_soil import ContactSoil
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.soil.soils import soil_named
from studies.soil.trials import plate_sinkage

FLAT = np.zeros((101, 101))


Law = type[Soil] | type[ContactSoil]
LAWS = [Soil, ContactSoil]


def laid(world: World, name: str, law: Law = Soil, config: SoilConfig | None = None) -> Any:
    """The soil of a world's ground: heights that contacts change, or the law of the contacts themselves."""
    if law is Soil:
        return Soil(world.terrain, name, BulletBodies(world.client, world), config)
    world.ground.set_soil(soil := ContactSoil(world.terrain, name))
    return soil


def run(world: World, soil: Any, seconds: float, every: int = 1) -> float:
    """Step a world with its soil, which changes in every so many steps; return the time of its last change [s]."""
    last = 0.0
    for step in range(1, 1 + round(seconds / world.dt)):
        world.step()
        if isinstance(soil, ContactSoil):
            continue
        if step % every:
            soil.note(world.contacts())
        elif soil.apply(world.contacts(), every * world.dt, world.time):
            last = world.time
    return last


@pytest.mark.parametrize("every", [1, 4])
def test_a_box_sinks_to_the_closed_form_then_rests_and_sleeps(every: int) -> None:
    """Also where the ground changes by the mean of some steps."""
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("box", Box(0.2, 0.2, 0.2), 5e3 * 0.04 / 9.81, BodyState((2.003, 2.007, 0.1005)))
        soil = laid(world, "lunar")
        assert run(world, soil, 2.0, every) < 0.6
        assert 0.1 - world.state("box").position[2] == pytest.approx(
            plate_sinkage(soil_named("lunar"), 0.2, 5e3), rel=0.1
        )
        assert world.is_asleep("box")


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("shape", [Box(0.3, 0.3, 0.3), Sphere(0.15), Cylinder(radius=0.15, height=0.2)])
def test_a_heavy_body_dropped_from_a_metre_is_neither_lost_nor_thrown(shape: Shape, law: Law) -> None:
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("heavy", shape, 40.0, BodyState((2.0, 2.0, 1.15)))
        soil, heights = laid(world, "lunar", law), []
        for _ in range(960):
            run(world, soil, world.dt)
            heights.append(world.state("heavy").position[2])
        assert max(islice(heights, int(np.argmax(np.array(heights) < 0.2)), None)) < 0.25
        assert law is Soil or max(heights[200:]) - min(heights) < 1e-3
        assert 0.0 < soil.sinkage().max() < 0.2
        assert world.rescues == 0


@pytest.mark.parametrize("law", LAWS)
def test_a_sliding_box_is_held_by_the_shear_strength(law: Law) -> None:
    """On a slope below the angle of friction a box creeps by millimetres and stays; above, it slides."""
    x = np.tile(0.04 * np.arange(101), (101, 1))
    for degrees in (15.0, 45.0):
        with World(HeightMap(-math.tan(math.radians(degrees)) * x, resolution=0.04)) as world:
            world.spawn("box", Box(0.2, 0.2, 0.1), 20.0, BodyState((2.0, 2.0, 0.0)), on_ground=True, align=True)
            soil, places = laid(world, "dry_sand", law), [2.0]
            for seconds in (1.0, 0.5, 0.5):
                run(world, soil, seconds)
                places.append(world.state("box").position[0])
        first, more, last = np.diff(places)
        if degrees > 30.0:
            assert more + (first if law is Soil else last) > 0.3
        elif law is Soil:
            assert first + more < 0.1
        else:
            assert 0.0 < first < 0.03
            assert more + last < 1e-4


def test_lost_contact_and_removed_bodies_leave_their_print() -> None:
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("box", Box(0.2, 0.2, 0.2), 20.0, BodyState((2.0, 2.0, 0.101)))
        soil = laid(world, "lunar")
        run(world, soil, 0.5)
        deep = soil.sinkage().max()
        world.move("box", BodyState((2.0, 2.0, 1.0)))
        run(world, soil, 0.3)
        world.remove("box")
        run(world, soil, 1.0)
        assert soil.results() == {}
        assert soil.sinkage().max() == pytest.approx(deep, rel=0.05)


def test_bodies_that_the_world_reads_at_once_are_those_that_pybullet_reports() -> None:
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        for k, shape in enumerate((Box(0.2, 0.1, 0.3), Sphere(0.1), Cylinder(radius=0.1, height=0.2))):
            world.spawn(f"b{k}", shape, 5.0, BodyState((1.0 + 0.5 * k, 2.0, 0.4), angular=(1.0, 2.0, 3.0)))
        bodies, names = BulletBodies(world.client, world), ["b2", "b0", "b1"]
        one_by_one = BulletBodies(world.client)
        for name in names:
            one_by_one.add(name, world.bodies[name].uid, shape=world.bodies[name].outline.body_shape)
        for number in range(60):
            world.step()
            if number == 30:
                world.move("b0", BodyState((3.0, 3.0, 0.3)))
            shapes, states = bodies.read(names)
            reported = one_by_one.read(names)
            assert [shape.record for shape in shapes if shape] == [shape.record for shape in reported.shapes if shape]
            np.testing.assert_array_equal(states, reported.states)
        world.remove("b0")
        assert [shape is None for shape in bodies.read([*names, "ghost"]).shapes] == [False, True, False, True]
        world.spawn("b0", Sphere(0.3), 1.0, BodyState((2.0, 1.0, 1.0)))
        again = bodies.read(names)
        assert again.shapes[1].record == ball(0.3).record
        assert again.states[1, :3].tolist() == [2.0, 1.0, 1.0]


def test_soil_without_grip_leaves_friction_alone() -> None:
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("box", Box(0.2, 0.2, 0.2), 20.0, BodyState((2.0, 2.0, 0.101)))
        soil = laid(world, "lunar", config=SoilConfig(grip=False))
        run(world, soil, 0.3)
        assert world.client.getDynamicsInfo(world.bodies["box"].uid, -1)[1] == pytest.approx(0.5)


def test_soil_that_flows_does_not_throw_what_rolls_through_it() -> None:
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        world.spawn("ball", Sphere(0.15), 40.0, BodyState((1.0, 2.0, 0.151), linear=(1.5, 0.0, 0.0)))
        soil = laid(world, "lunar", config=SoilConfig(flow=1.0, slides=5))
        for _ in range(480):
            world.step()
            soil.apply(world.contacts(), world.dt, world.time)
            assert world.state("ball").position[2] < 0.3  # it may hop out of its own crater
        assert soil.map.heights.max() > 0.002  # a rim
        assert soil.sinkage().max() > 0.01
