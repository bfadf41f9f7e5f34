"""Soil in a PyBullet world: what falls, slides and leaves, what stands on soil that moves, and what is refused."""

import math
from collections.abc import Callable
from itertools import islice
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, HeightMap, InputError, Material, MotionConfig, Soil, SoilType, World
from smartmesh_ros.ground.shapes import Box, Cylinder, Shape, Sphere
from smartmesh_ros.soil.config import soil_named
from tests.bodies import LYING, UPRIGHT, Turn, about_z
from tests.grounds import Soils, level, moving, on_soil

FLAT = np.zeros((101, 101))
ALONG = np.tile(0.04 * np.arange(-50, 51), (101, 1))  # [m], from the middle
BOX = Box(0.2, 0.2, 0.2)


def world_on(soil: Soils, heights: np.ndarray = FLAT, **physics: Any) -> World:
    """A world on soil of these heights."""
    return on_soil(HeightMap(heights, resolution=0.04), soil, **physics)


@pytest.mark.parametrize("shape", [Box(0.3, 0.3, 0.3), Sphere(0.15), Cylinder(radius=0.15, height=0.2)])
def test_a_heavy_body_dropped_from_a_metre_is_neither_lost_nor_thrown(shape: Shape) -> None:
    with world_on("lunar") as world:
        world.spawn("heavy", shape, 40.0, BodyState((2.0, 2.0, 1.15)))
        heights = []
        for _ in range(960):
            world.step()
            heights.append(world.state("heavy").position[2])
        assert max(islice(heights, int(np.argmax(np.array(heights) < 0.2)), None)) < 0.25
        assert max(heights[200:]) - min(heights) < 1e-3
        assert 0.0 < world.ground.soil.sinkage().max() < 0.2
        assert world.rescues == 0


@pytest.mark.parametrize("rate", [60.0, 240.0])
@pytest.mark.parametrize(
    ("shape", "mass", "soil"),
    [
        (Box(0.3, 0.2, 0.1), 10.0, "dry_sand"),
        (Box(0.8, 0.8, 0.1), 40.0, "dry_sand"),
        (Box(0.4, 0.4, 0.05), 5.0, "lunar"),
        (Box(0.1, 0.1, 0.4), 10.0, "clay"),
        (Cylinder(radius=0.15, height=0.1), 5.0, "dry_sand"),
    ],
)
def test_what_is_kept_awake_on_soil_lies_still(shape: Shape, mass: float, soil: str, rate: float) -> None:
    """Light and wide or tall, also on a slope: it neither rocks nor digs itself in, and the soil bears its weight."""
    for slope in (0.0, 0.15):
        with world_on(soil, slope * ALONG, rate=rate, sleep=False) as world:
            world.spawn("body", shape, mass, BodyState((2.003, 1.997, 0.0)), on_ground=True, align=True)
            world.step(round(3.0 * rate))
            start = world.state("body").position
            for _ in range(round(rate)):
                world.step()
                assert sum(wrench.force[2] for wrench in world.wrenches()) == pytest.approx(9.81 * mass, rel=0.02)
            assert world.state("body").position == pytest.approx(start, abs=5e-5)


def test_a_box_below_the_angle_of_friction_creeps_and_stays() -> None:
    with world_on("dry_sand", -math.tan(math.radians(15.0)) * ALONG) as world:
        world.spawn("box", Box(0.2, 0.2, 0.1), 20.0, BodyState((2.0, 2.0, 0.0)), on_ground=True, align=True)
        places = [2.0]
        for seconds in (1.0, 0.5, 0.5):
            world.step(round(seconds / world.dt))
            places.append(world.state("box").position[0])
    first, more, last = np.diff(places)
    assert 0.0 < first < 0.03
    assert more + last < 1e-4


@pytest.mark.parametrize("rate", [240.0, 960.0])
@pytest.mark.parametrize("degrees", [31.0, 33.0, 34.5])
def test_a_low_box_slides_as_the_shear_strength_lets_it(degrees: float, rate: float) -> None:
    """Mohr and Coulomb's law: the soil holds it by c A + N tan(phi)."""
    mass, slope, soil = 80.0, math.radians(degrees), soil_named("dry_sand")
    friction = math.tan(math.radians(soil.Mohr_friction))
    strength = soil.Mohr_cohesion * 0.2 * 0.2 / mass + 9.81 * math.cos(slope) * friction
    heights = -math.tan(slope) * np.tile(0.04 * np.arange(201), (101, 1))
    with world_on("dry_sand", heights, rate=rate) as world:
        world.spawn("box", Box(0.2, 0.2, 0.02), mass, BodyState((1.0, 2.0, 0.0)), on_ground=True, align=True)
        world.step(round(rate))
        before = np.linalg.norm(world.state("box").linear)
        world.step(round(rate))
        gained = np.linalg.norm(world.state("box").linear) - before
    assert 9.81 * math.sin(slope) - gained == pytest.approx(strength, rel=0.05)


@pytest.mark.parametrize(
    ("shape", "turn", "arm", "inertia"),
    [
        (Box(0.3, 0.3, 0.1), UPRIGHT, 0.115, 0.015),
        (Cylinder(radius=0.15, height=0.1), UPRIGHT, 0.1, 0.01125),
        (Cylinder(radius=0.1, height=0.6), LYING, 0.15, 0.0325),
    ],
)
def test_what_spins_in_place_is_stopped_by_the_shear_strength(
    shape: Shape, turn: Turn, arm: float, inertia: float
) -> None:
    """At a mean distance ``arm`` from its middle [m]; ``inertia``: over the mass [m^2]."""
    with world_on("dry_sand") as world:
        world.spawn("body", shape, 20.0, BodyState((2.003, 2.007, 0.0), turn), on_ground=True)
        world.step(120)
        world.client.resetBaseVelocity(world.body("body").uid, (0.0, 0.0, 0.0), (0.0, 0.0, 10.0))
        known, area = soil_named("dry_sand"), world.ground.on_soil()["body"].area
        strength = known.Mohr_cohesion * area + 20.0 * 9.81 * math.tan(math.radians(known.Mohr_friction))
        slowing = strength * arm / (20.0 * inertia)
        world.step(round(0.5 * 10.0 / slowing / world.dt))
        assert 4.0 < world.state("body").angular[2] < 7.0
        world.step(round(0.8 * 10.0 / slowing / world.dt))
        assert world.state("body").angular == pytest.approx((0.0, 0.0, 0.0), abs=0.1)


def test_what_sleeps_on_hard_soil_sinks_when_soft_soil_lies_there() -> None:
    """By an assignment to the map, and by a map that scrolled: its soils stay with the ground. Kinds that are not there
    count as the last, also in a saved state, and a map that says none has the first."""
    for scrolls, kind in ((False, 200), (True, 1)):
        with world_on(["lunar", "clay"]) as world:
            world.spawn("box", BOX, 20.0, BodyState((2.0, 2.0, 0.1)))
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


def test_what_slept_on_soil_and_touches_nothing_any_more_is_not_carried() -> None:
    """PyBullet keeps it from the ground, and the contacts in which it fell asleep are gone."""
    with world_on("dry_sand") as world:
        world.spawn("box", BOX, 20.0, BodyState((2.0, 2.0, 0.1)))
        world.step(240)
        assert world.is_asleep("box")
        assert "box" in world.ground.on_soil()
        box = world.bodies["box"].uid
        world.client.setCollisionFilterGroupMask(box, -1, 0, 0)
        world.client.changeDynamics(box, -1, activationState=pb.ACTIVATION_STATE_WAKE_UP)
        world.step()
        assert world.ground.on_soil() == {}


def test_soils_are_where_kinds_say() -> None:
    kinds = np.asfortranarray(np.tile(np.arange(101, dtype=np.uint8) // 51, (101, 1)))
    with World(HeightMap(FLAT, resolution=0.04)) as world:
        for name, x in (("lunar", 1.0), ("clay", 3.0)):
            world.spawn(name, BOX, 20.0, BodyState((x, 2.0, 0.1)))
        world.ground.set_soil(soil := Soil(world.terrain, ["lunar", "clay"], kinds=kinds))
        world.step(240)
        found = world.ground.on_soil()
        assert found["lunar"].sinkage > 5e-3 > 5e-4 > found["clay"].sinkage
        soil.reset()
        assert not soil.sinkage().any()


@pytest.mark.parametrize("samples", [1, 4, 5])
def test_the_map_is_lower_by_the_sinkage_of_its_samples(samples: int) -> None:
    """Also of those at the edge of a print, and where fine samples lie in the middle between two of the map."""
    with world_on("lunar", spacing=0.04 / samples) as world:
        soil = world.ground.soil
        world.spawn("ball", Sphere(0.15), 20.0, BodyState((2.003, 1.987, 0.15), linear=(0.4, 0.3, 0.0)))
        world.step(240)
        soil.show()
        assert soil.sinkage().max() > 0.01
        np.testing.assert_allclose(soil.map.heights, -soil.sinkage(), atol=1e-6)


@pytest.mark.parametrize(("velocity", "spin"), [((3.0, -1.0), 0.0), ((0.0, 0.0), 0.5), ((0.3, 0.2), -0.7)])
def test_a_box_on_soil_that_slides_or_turns_sinks_as_on_soil_at_rest_and_moves_with_it(
    velocity: tuple[float, float], spin: float
) -> None:
    """It is set down at the velocity of its place, and shears the soil until that holds it on its circle."""
    heightmap = HeightMap(FLAT, resolution=0.04)
    heightmap.slide(velocity, 100.0, spin=spin)
    with on_soil(heightmap, "dry_sand") as world:
        linear = velocity[0] - 0.3 * spin, velocity[1] + 0.4 * spin, 0.0
        world.spawn("box", BOX, 20.0, BodyState((0.4, 0.3, 0.1), linear=linear, angular=(0.0, 0.0, spin)))
        places = []
        for _ in range(2):
            world.step(480)
            grid, state = heightmap.placed_at(world.time), world.state("box")
            x, y = np.subtract(state.position[:2], grid.origin[:2])
            cos, sin = math.cos(grid.yaw), math.sin(grid.yaw)
            places.append((cos * x + sin * y, cos * y - sin * x))
            there = about_z(grid.yaw)
            assert abs(np.dot(state.orientation, there)) == pytest.approx(1.0, abs=1e-5)
            assert state.position[2] == pytest.approx(0.1 - 5.4e-3, abs=1e-4)
        assert places[0] == pytest.approx((0.4, 0.3), abs=0.01)
        assert places[1] == pytest.approx(places[0], abs=1e-5)


@pytest.mark.parametrize("soil", ["dry_sand", "clay"])
def test_what_sleeps_on_soil_that_begins_to_rock_is_neither_kicked_nor_shaken(soil: str) -> None:
    """By 6 degrees in 8 s; the force of the soil is the weight."""
    with on_soil(HeightMap(FLAT, resolution=0.04, origin=(-2.0, -2.0)), soil) as world:
        world.spawn("box", BOX, 20.0, BodyState((1.313, 0.17, 0.1)))
        world.step(240)
        assert world.is_asleep("box")
        start, sunk = world.time, 0.1 - world.state("box").position[2]

        def slope(time: float) -> float:
            return 0.05 * (1.0 - math.cos(math.tau * (time - start) / 8.0))

        forces = []
        for _ in moving(world, lambda time: slope(time) * ALONG, 1920):
            (wrench,) = world.wrenches()
            forces.append(wrench.force[2] / (20.0 * 9.81))
            x, _, z = world.state("box").position
            depth = 0.1 - (z - slope(world.time) * x) * math.cos(math.atan(slope(world.time)))
            assert depth == pytest.approx(sunk, abs=2e-3)
        assert max(forces) < 2.0
        assert 0.85 < min(forces[240:]) < max(forces[240:]) < 1.15


SAND = {
    "Bekker_Kphi": 1e6, "Bekker_Kc": 0.0, "Bekker_n": 1.0, "Mohr_cohesion": 0.0, "Mohr_friction": 30.0,
    "Janosi_shear": 0.01,
}  # fmt: skip


OWN = "{Bekker_Kphi: 1.5e6, Bekker_Kc: 990, Bekker_n: 1.1, Mohr_cohesion: 1e3, Mohr_friction: 28, Janosi_shear: 0.01}"


def of_kinds(kinds: np.ndarray) -> Soil:
    return Soil(HeightMap(np.zeros((20, 20)), resolution=1.0), ["lunar", "clay"], kinds=kinds)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SoilType(**{**SAND, "Bekker_Kphi": -1.0}), "Bekker_Kphi is -1"),
        (lambda: SoilType(**{**SAND, "Mohr_friction": 90.0}), "Mohr_friction is 90"),
        (lambda: SoilType(**{**SAND, "elastic_K": 5e5}), "not above Bekker_Kphi"),
        (lambda: soil_named("cheese"), "no soil 'cheese'; known: dry_sand"),
        (lambda: soil_named("{Bekker_Kphi: 1e6, Bekker_n: 1.0}"), "lacks Bekker_Kc, Mohr_cohesion, Mohr_friction"),
        (lambda: soil_named("{stiffness: 3}"), "no parameter 'stiffness'; the parameters are Bekker_Kphi"),
        (lambda: soil_named("{Bekker_Kphi: "), "is no YAML"),
        *(
            (lambda text=text: soil_named(f"{{Bekker_Kphi: {text}"), "is no YAML")
            for text in ("2024-13-01}", "!!bool soft}", "!!timestamp now}", "{" * 2000)
        ),
        (lambda: soil_named(OWN.replace("1.1", "soft")), "Bekker_n is 'soft'"),
        (lambda: of_kinds(np.zeros((3, 3), np.uint8)), r"shape \(3, 3\)"),
        (lambda: of_kinds(np.full((20, 20), 2)), "kinds are up to 2"),
        (lambda: of_kinds(np.full((20, 20), 255)), "255 to 255"),
        (lambda: of_kinds(np.zeros((20, 20))), "whole numbers"),
        (lambda: Soil(level(), "lunar", spacing=0.0), "spacing"),
        *((lambda on=on: Soil(level(), "lunar", slip_sinkage=on), "slip_sinkage is") for on in ("no", None, 1)),
        (lambda: Soil(level(101, 10.0), "lunar"), r"on cells of 10 m; it must be above 0\.01 m"),
        (lambda: Soil(level(1000, 5.0), "lunar"), "raise spacing"),
        *((lambda soil=soil: Soil(level(), soil), "is no soil; give a SoilType") for soil in (5, [5], None)),
        (lambda: Soil(level(motion=MotionConfig(changes="correction")), "lunar"), "corrections"),
    ],
)
def test_what_cannot_be_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


def test_parameters_of_numpy_are_those_of_python() -> None:
    given = {name: np.float32(value) for name, value in SAND.items()}
    assert SoilType(**given) == SoilType(**{name: float(value) for name, value in given.items()})


def test_a_soil_of_ones_own_may_be_a_text() -> None:
    given = SoilType(
        Bekker_Kphi=1.5e6, Bekker_Kc=990.0, Bekker_n=1.1, Mohr_cohesion=1e3, Mohr_friction=28.0, Janosi_shear=0.01
    )
    assert soil_named(OWN) == given


@pytest.mark.parametrize("shape", [Box(0.2, 0.2, 0.2), Sphere(0.1), Cylinder(radius=0.1, height=0.2)])
def test_a_map_that_is_higher_at_once_lifts_what_stands_in_its_soil(shape: Shape) -> None:
    """Without a velocity, as after a long break. What stood there is below the new ground; its print goes along."""
    with world_on("dry_sand") as world:
        world.spawn("body", shape, 10.0, BodyState((2.0, 2.0, 0.1)))
        world.step(240)
        before = world.state("body").position[2]
        world.terrain.tile("").replace(FLAT + 0.3, time=world.time + 100.0)
        heights = []
        for _ in range(240):
            world.step()
            heights.append(world.state("body").position[2] - 0.3)
        assert max(heights) < 0.12
        assert before - 0.02 < heights[-1] <= before + 1e-3
