"""Bodies that lean on soil: what faces the ground bears them, wherever their middle is, and they gain no energy."""

import math

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, Sphere, World
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from studies.soil.vehicles import Cart, set_down
from tests.bodies import about_z, random_turn
from tests.grounds import energy_of
from tests.soil.test_soil_world import ALONG, world_on

MASS = 20.0  # of plates [kg]


def energies(world: World, name: str, steps: int) -> FloatArray:
    """Return the energy [J] of a body now and after each of some steps (steps + 1,)."""
    found = [energy_of(world, name)]
    for _ in range(steps):
        world.step()
        found.append(energy_of(world, name))
    return np.array(found)


def most_gained(world: World, name: str, steps: int) -> float:
    """Return by how much the energy of a body ever rose over its least so far, in some steps [J]."""
    found = energies(world, name, steps)
    return float(np.max(found - np.minimum.accumulate(found)))


@pytest.mark.parametrize("soil", ["dry_sand", "clay"])
@pytest.mark.parametrize(
    ("plate", "thickness"),
    [
        (Box(0.4, 0.02, 0.3), 0.02),
        (Box(0.02, 0.4, 0.3), 0.02),
        (Box(0.4, 0.1, 0.4), 0.1),
        (Cylinder(radius=0.2, height=0.05), 0.05),
    ],
)
def test_a_plate_on_its_edge_falls_over_and_is_neither_thrown_nor_swallowed(
    plate: Shape, thickness: float, soil: str
) -> None:
    for yaw, lean in ((0.0, 3.0), (0.5, 3.0), (0.0, 12.0), (0.5, 25.0), (0.0, 45.0)):
        on_edge = 90.0 if isinstance(plate, Cylinder) else 0.0
        tilt = pb.getQuaternionFromEuler((math.radians(on_edge + lean), 0.0, yaw))
        with world_on(soil, sleep=False) as world:
            world.spawn("plate", plate, MASS, BodyState((2.003, 1.997, 0.0), tilt), on_ground=True)
            found = energies(world, "plate", 720)
            assert found.max() < found[0] + 5.0  # it is 25 mm higher then
            assert world.state("plate").position[2] > 0.5 * thickness - 0.015
            assert abs(np.array(world.state("plate").linear)).max() < 0.05


@pytest.mark.parametrize("soil", ["dry_sand", "clay", "lunar"])
def test_wheels_across_a_slope_sink_as_deep_as_on_level_ground(soil: str) -> None:
    """Their lowest points are beside their middles. The lower wheels bear more than the upper ones."""
    cart = Cart(radius=0.2, width=0.1, mass=60.0, wheel_mass=5.0, base=0.8, track=0.8)
    found = []
    for slope in (0.0, 0.3):
        with world_on(soil, slope * ALONG, spacing=0.02, sleep=False) as world:
            start = BodyState((2.003, 2.007, 0.0), about_z(0.5 * math.pi))
            world.spawn_robot("cart", cart.urdf, start, on_ground=True, align=True)
            world.step(480)
            found.append([support.sinkage for support in world.ground.on_soil().values()])
    level, across = np.array(found)
    assert across == pytest.approx(level, rel=0.4)
    assert across.mean() == pytest.approx(level.mean(), rel=0.15)


def test_a_box_at_a_cliff_of_soil_stands_on_its_top() -> None:
    """A fifth of it is beyond the edge. The cliff is no slope that it lies on."""
    found = []
    for depth in (0.0, 0.5):
        with world_on("dry_sand", np.where(ALONG > 0.1, -depth, 0.0), sleep=False) as world:
            world.spawn("box", Box(0.2, 0.2, 0.2), MASS, BodyState((2.02, 2.007, 0.1)))
            world.step(480)
            found.append(0.1 - world.state("box").position[2])
    assert found[0] < found[1] < 3.0 * found[0]


@pytest.mark.parametrize("speed", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("shape", [Sphere(0.1), Cylinder(radius=0.1, height=0.1)])
def test_a_wall_of_soil_higher_than_a_body_does_not_throw_it_up(shape: Shape, speed: float) -> None:
    """Nobody pressed the wall down to the body's underside."""
    soft = "{Bekker_Kphi: 1e5, Bekker_Kc: 0, Bekker_n: 1, Mohr_cohesion: 100, Mohr_friction: 30, Janosi_shear: 0.01}"
    with world_on(soft, sleep=False) as world:
        world.spawn("press", Box(0.8, 0.8, 0.8), 4000.0, BodyState((2.0, 2.0, 0.4)))
        world.step(480)
        floor = world.state("press").position[2] - 0.4
        assert floor < -0.5
        world.remove("press")
        world.step()
        lying = pb.getQuaternionFromEuler((math.radians(90.0), 0.0, 0.0))
        start = BodyState((2.0, 2.0, floor + 0.1), lying, (speed, 0.0, 0.0), (0.0, speed / 0.1, 0.0))
        world.spawn("body", shape, 2.0, start)
        tops = []
        for _ in range(480):
            world.step()
            tops.append(world.state("body").position[2] - floor - 0.1)
        assert max(tops) < 0.75 * speed**2 / 9.81 + 0.05  # as high as its energy, with that of its spin, may lift it


@pytest.mark.parametrize("rate", [60.0, 240.0])
@pytest.mark.parametrize("soil", ["sandy_loam", "clay"])
@pytest.mark.parametrize(
    "shape",
    [
        Cylinder(radius=0.2, height=0.04),
        Cylinder(radius=0.1, height=0.1),
        Cylinder(radius=0.03, height=0.6),
        Box(0.4, 0.3, 0.02),
    ],
)
def test_soil_gives_no_energy_to_what_is_thrown_onto_it_anyhow(shape: Shape, soil: str, rate: float) -> None:
    """Its rim or its flat end leaves while the other comes down, and edges cut in from the side."""
    random = np.random.default_rng(5)
    for slope in (0.0, 0.25, 0.5) * 3:
        start = BodyState(
            (1.8, 2.0, 0.45),
            tuple(random_turn(random)),
            (random.uniform(1.0, 3.0), 0.0, random.uniform(-3.0, 0.0)),
            tuple(random.uniform(-9.0, 9.0, 3)),
        )
        with world_on(soil, -slope * ALONG, rate=rate) as world:
            world.spawn("body", shape, MASS, start)
            assert most_gained(world, "body", round(0.6 * rate)) < 0.03 * MASS


@pytest.mark.parametrize("rate", [60.0, 240.0, 960.0])
def test_a_thin_plate_that_cuts_into_the_soil_is_not_lifted_out_of_it(rate: float) -> None:
    """Its middle is below soil that it has not pressed. As in all ground that gives, a part of it is above."""
    turn, spin = (-0.016, 0.307, -0.786, 0.537), (5.492, -5.577, -7.328)
    with world_on("clay", -0.25 * ALONG, rate=rate) as world:
        world.spawn("plate", Box(0.4, 0.3, 0.02), MASS, BodyState((1.8, 2.0, 0.45), turn, (2.792, 0.0, -2.919), spin))
        assert most_gained(world, "plate", round(0.6 * rate)) < 0.03 * MASS
        assert world.rescues == 0


@pytest.mark.parametrize("step", [0.0, 0.06, 0.126])
@pytest.mark.parametrize("soil", ["lunar", "sandy_loam", "clay", "dry_sand"])
def test_soil_gives_no_energy_to_a_box_that_tumbles(soil: str, step: float) -> None:
    """Neither on level ground nor at a step of it: it gives back no more than what it stored as a spring."""
    heights, mass = np.where(ALONG > 0.2, step, 0.0), 5.0
    for lean, speed, turning in ((0.03, 1.8, 0.8), (0.17, 3.8, 7.3), (0.38, 3.5, 15.7)):
        with world_on(soil, heights) as world:
            orientation = (0.0, math.sin(lean / 2), 0.0, math.cos(lean / 2))
            state = BodyState((1.9, 2.0, 0.22), orientation, (speed, 0.0, 0.0), (0.0, turning, 0.0))
            world.spawn("box", Box(0.2, 0.2, 0.2), mass, state)
            assert most_gained(world, "box", 240) < 0.03 * mass


@pytest.mark.parametrize(
    ("number", "rate"),
    [*((number, 60.0) for number in range(16)), *((number, 240.0) for number in (0, 3, 4, 7, 9, 10, 13, 14))],
)
def test_energy_never_grows_in_set_downs(number: int, rate: float) -> None:
    rose = set_down(number, ("dry_sand", "lunar", "clay", "hit_lss1")[number % 4], rate=rate).rose
    assert rose < (1e-4 if rate == 240.0 else 3e-3)
