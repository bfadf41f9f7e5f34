"""Soil whose law is that of contacts: laws of plates, wheels and carts in PyBullet."""

import math
from dataclasses import replace

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, HeightMap, InputError, SoilType, Sphere, World
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.soil.config import soil_named
from studies.soil.trials import Wheel, free_slip, modulus_of, plate_sinkage, undamped, wheel_forces
from studies.soil.vehicles import BELOW, WARTHOG, Cart, drive, roll
from tests.bodies import about_z
from tests.grounds import on_soil, step_on_moving
from tests.soil.test_soil_world import world_on

SOILS = ("dry_sand", "clay", "sandy_loam", "lunar", "hit_lss1", "lete_sand", "chrono_rig", "k10_sand")
FLAT = np.zeros((101, 101))
WEIGHT = 5e3 * 0.04  # [N] of a box of 0.2 m under 5 kPa


def with_box(soil: str, grid: float = 0.04, place: tuple[float, float] = (2.003, 2.007), height: float = 0.1) -> World:
    """Return a world with a box of 0.2 m that presses a soil with 5 kPa."""
    side = round(4.0 / grid) + 1
    world = on_soil(HeightMap(np.zeros((side, side)), resolution=grid), soil)
    world.spawn("box", Box(0.2, 0.2, 0.2), WEIGHT / 9.81, BodyState((*place, height)))
    return world


@pytest.mark.parametrize("soil", SOILS)
def test_a_plate_that_is_set_down_comes_to_bekkers_depth_and_sleeps(soil: str) -> None:
    with with_box(soil) as world:
        world.step(720)
        wanted = plate_sinkage(soil_named(soil), 0.2, 5e3)
        assert 0.1 - world.state("box").position[2] == pytest.approx(wanted, rel=0.01, abs=1e-4)
        support = world.ground.on_soil()["box"]
        assert support.area == pytest.approx(0.04, rel=0.01)
        assert support.carried == pytest.approx(WEIGHT, rel=0.01)
        assert world.is_asleep("box")


def carried(soil: SoilType, wheel: Wheel, sinkage: float) -> float:
    """Return the force [N] that carries a wheel which does not roll: the pressures under its rim are those of plates at
    the same depth."""
    x = np.linspace(0.0, np.sqrt(2.0 * wheel.radius * sinkage - sinkage**2), 4001)
    depth = np.maximum(np.sqrt(wheel.radius**2 - x**2) - wheel.radius + sinkage, 0.0)
    return 2.0 * wheel.width * float(np.trapezoid(modulus_of(soil, wheel.width) * depth**soil.Bekker_n, x))


@pytest.mark.parametrize(("soil", "tons"), [("dry_sand", 5), ("clay", 50), ("lunar", 50)])
def test_heavy_machines_that_are_set_down_sink_as_deep_as_the_soil_carries_them(soil: str, tons: int) -> None:
    """On wheels, by the integral of Bekker's law over their rims; on a plate, by the law itself."""
    known, grow = soil_named(soil), (tons / 5.0) ** (1.0 / 3.0)
    cart = Cart(
        radius=0.6 * grow, width=0.45 * grow, mass=1e3 * tons, wheel_mass=30.0 * tons, base=2.5 * grow, track=2.0 * grow
    )
    with on_soil(HeightMap(np.zeros((121, 121)), resolution=0.2), soil, spacing=0.02 * grow) as world:
        world.spawn_robot("cart", cart.urdf, BodyState((6.0, 6.0, cart.radius + BELOW)))
        world.spawn("plate", Box(grow, grow, grow), 1e3 * tons, BodyState((15.0, 15.0, 0.5 * grow)))
        world.step(720)
        found = world.ground.on_soil()
    assert found.pop("plate").sinkage == pytest.approx(plate_sinkage(known, grow, 9810.0 * tons / grow**2), rel=0.02)
    assert len(found) == 4
    for support in found.values():
        less, more = (carried(known, cart.wheel, share * support.sinkage) for share in (0.95, 1.05))
        assert less < cart.wheel.load < more


def test_a_post_on_its_end_comes_to_bekkers_depth_with_its_radius_as_the_width() -> None:
    with world_on("clay") as world:
        world.spawn("post", Cylinder(radius=0.1, height=0.3), 200.0, BodyState((2.003, 2.007, 0.15)))
        world.step(480)
        wanted = plate_sinkage(soil_named("clay"), 0.1, 200.0 * 9.81 / (np.pi * 0.01))
        assert world.ground.on_soil()["post"].sinkage == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize(
    ("length", "width", "heading", "share"),
    [(0.4, 0.4, 0.0, 0.3), (0.4, 0.4, 0.0, 0.7), (1.2, 0.15, 0.0, 0.5), (0.15, 1.2, 0.0, 0.5), (0.3, 0.05, 0.0, 0.5),
     (0.3, 0.05, 0.35, 0.5)],
)  # fmt: skip
def test_a_belt_that_pulls_slips_by_janosis_law_of_its_own_length(
    length: float, width: float, heading: float, share: float
) -> None:
    """By that ``share`` of the strength of the soil. With a slip i, a belt of a length L shears it by i L / 2 in the
    mean."""
    known, speed, mass = soil_named("lete_sand"), 0.2, 80.0
    strength = length * width * known.Mohr_cohesion + mass * 9.81 * np.tan(np.radians(known.Mohr_friction))
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    with world_on(known) as world:
        world.spawn("belt", Box(length, width, 0.1), mass, BodyState((1.0, 1.503, 0.05), about_z(heading)))
        world.drive_surface("belt", "", speed)
        places = []
        for step in range(1200):
            place = np.array(world.state("belt").position)
            pull = share * strength * min(step / 480.0, 1.0)
            uid, at = world.bodies["belt"].uid, place - (0.0, 0.0, 0.05)
            world.client.applyExternalForce(uid, -1, (-pull * ahead).tolist(), at.tolist(), pb.WORLD_FRAME)
            world.step()
            places.append(place @ ahead)
    slip = 1.0 - (places[-1] - places[-481]) / (speed * 2.0)
    assert slip == pytest.approx(-2.0 * known.Janosi_shear / length * np.log(1.0 - share), rel=0.08)


@pytest.mark.parametrize("shape", [Box(0.2, 0.2, 0.04), Cylinder(radius=0.1, height=0.04)])
def test_what_slides_back_over_its_start_is_held_by_the_whole_strength(shape: Shape) -> None:
    """Janosi and Hanamoto's stress turns round within a few shear moduli, wherever the body was when it did."""
    soil = soil_named("dry_sand")
    with world_on("dry_sand", sleep=False) as world:
        world.spawn("body", shape, 20.0, BodyState((2.003, 2.007, 0.0)), on_ground=True)
        world.step(120)
        strength = soil.Mohr_cohesion * world.ground.on_soil()["body"].area / 20.0 + 9.81 * np.tan(
            np.radians(soil.Mohr_friction)
        )
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


def test_a_body_that_falls_onto_the_soil_is_not_set_down() -> None:
    """The energy of its fall presses the soil: m g (h + z) = k A z^(n + 1) / (n + 1), without damping."""
    known, fall = replace(undamped(soil_named("lunar")), Bekker_n=1.0), 0.1
    with world_on(known, rate=1000.0) as world:
        world.spawn("box", Box(0.2, 0.2, 0.2), WEIGHT / 9.81, BodyState((2.003, 2.007, 0.1 + fall)))
        world.step(1000)
        stiffness = (known.Bekker_Kc / 0.2 + known.Bekker_Kphi) * 0.04
        wanted = (WEIGHT + np.sqrt(WEIGHT**2 + 2.0 * stiffness * WEIGHT * fall)) / stiffness
        assert world.ground.on_soil()["box"].sinkage == pytest.approx(wanted, rel=0.1)


def test_changes_are_what_another_map_needs_to_look_alike() -> None:
    with with_box("dry_sand") as world:
        soil = world.ground.soil
        world.spawn("ball", Sphere(0.1), 5.0, BodyState((0.8, 3.0, 0.1), linear=(1.0, 0.0, 0.0)))
        copy = np.zeros(soil.map.heights.shape, np.float32)
        assert soil.changes(world.time, everything=True) is None, "nobody has pressed the soil"
        sizes = []
        for _ in range(40):
            world.step(8)
            if (found := soil.changes(world.time)) is not None:
                sizes.append(found.heights.size)
                height, width = found.heights.shape
                copy[found.row : found.row + height, found.column : found.column + width] = found.heights
            assert np.array_equal(copy, soil.map.heights)
        assert copy.min() < -1e-3
        assert min(sizes) < 100, "the box came to rest, and the ball changes the ground below it alone"
        everything = soil.changes(world.time, everything=True)
        assert everything is not None
        assert np.count_nonzero(everything.heights) == np.count_nonzero(soil.map.heights)
        assert soil.changes(world.time) is None


def test_a_map_that_is_sent_again_leaves_prints_and_what_stands_or_sleeps_in_them() -> None:
    """After so many steps each, the first never. Its sender knows of no prints, so they are no motion of the ground."""
    found = []
    for every in (1000, 1, 8, 60, 240):
        with with_box("dry_sand") as world:
            tile = world.terrain.tile("")
            for step in range(1, 481):
                world.step()
                if step % every == 0 and step < 480:
                    tile.replace(FLAT, time=world.time)
            box = world.state("box")
            found.append(np.concatenate([tile.heights.ravel(), box.position, box.linear]))
    assert found[0].min() < -5e-3
    for each in found[1:]:
        assert np.allclose(each, found[0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("sleeps", [True, False])
def test_prints_under_a_body_and_the_body_move_with_the_ground(sleeps: bool) -> None:
    with with_box("dry_sand") as world:
        world.configure(replace(world.config, physics=replace(world.config.physics, sleep=sleeps)))
        tile = world.terrain.tile("")
        world.step(240)
        assert world.is_asleep("box") == sleeps
        sunk, low, start = -tile.heights.min(), world.state("box").position[2], world.time

        def rise(time: float) -> float:
            after = time - start
            return 0.1 * after**2 if after < 0.5 else 0.1 * after - 0.025

        step_on_moving(world, rise, 240, every=8)
        assert world.state("box").position[2] - low == pytest.approx(0.075, abs=1e-3)
        assert world.state("box").linear == pytest.approx((0.0, 0.0, 0.1), abs=1e-3)
        world.ground.soil.show()
        assert tile.heights.max() - tile.heights.min() == pytest.approx(sunk, rel=0.2)


@pytest.mark.parametrize(
    ("soil", "cart", "drives", "error"),
    [
        *((soil, Cart(), {"seconds": 5.0}, 0.05) for soil in ("clay", "sandy_loam", "lunar", "lete_sand")),
        ("dry_sand", WARTHOG, {"speed": 0.5, "seconds": 4.0, "grid": 0.05}, 0.02),
    ],
)
def test_a_cart_slips_as_the_integrals_say_and_its_wheels_stay_loaded(
    soil: str, cart: Cart, drives: dict[str, float], error: float
) -> None:
    known = undamped(soil_named(soil))
    found = drive(cart, known, **drives)
    assert found.slip == pytest.approx(free_slip(known, cart.wheel), abs=error)
    assert found.unloaded < 0.01
    assert found.worst < 2.0


@pytest.mark.parametrize(("soil", "grid"), [("dry_sand", 0.02), ("dry_sand", 0.1), ("lunar", 0.05)])
def test_a_cart_slips_alike_at_every_heading(soil: str, grid: float) -> None:
    known = undamped(soil_named(soil))
    slips = [drive(Cart(), known, seconds=4.0, grid=grid, heading=math.radians(turn)).slip for turn in (0, 10, 30, 45)]
    assert slips == pytest.approx([free_slip(known, Cart().wheel)] * 4, abs=0.017)


@pytest.mark.parametrize(
    ("slip", "sinks", "implicit"),
    [
        *((slip, False, True) for slip in (-0.2, 0.15, 0.3, 0.7)),
        *((slip, *how) for slip in (-0.2, 0.7) for how in ((True, True), (False, False))),
    ],
)
def test_a_wheel_of_forced_slip_pulls_and_sinks_as_the_integrals_say(slip: float, sinks: bool, implicit: bool) -> None:
    """A wheel that is a mesh, not ``implicit``, does as the cylinder around it."""
    known, wheel = undamped(soil_named("k10_sand")), Wheel(radius=0.058, width=0.05, load=24.6)
    found = roll(wheel, known, slip, speed=0.05, slip_sinkage=sinks, implicit=implicit)
    wanted = wheel_forces(known, wheel, slip, sinks_by_slip=sinks)
    margin = 0.0 if implicit else 2e-3  # PyBullet's is 1 mm
    assert found.sinkage == pytest.approx(wanted.sinkage, rel=0.06, abs=margin)
    assert found.pull / wheel.load == pytest.approx(wanted.pull / wheel.load, abs=0.04)


@pytest.mark.parametrize("place", [(2.0, 2.0), (2.0, 2.003), (2.005, 2.005)])
def test_a_box_sinks_upright_and_as_deep_wherever_its_edges_are_among_the_samples(place: tuple[float, float]) -> None:
    depths = []
    for where in (place, (2.003, 2.007)):
        with with_box("dry_sand", grid=0.02, place=where) as world:
            world.step(120)
            depths.append(world.ground.on_soil()["box"].sinkage)
            assert abs(world.state("box").orientation[3]) > 1.0 - 1e-9
    assert depths[0] == pytest.approx(depths[1], rel=1e-3)


@pytest.mark.parametrize("soil", ["clay", "lunar"])
@pytest.mark.parametrize("depth", [2e-3, 0.06])
def test_a_body_that_is_put_into_the_soil_has_a_print_there_that_carries_it(soil: str, depth: float) -> None:
    """It never rises, and sinks only as far as the soil does not carry it. What is put into a print leaves it."""
    with with_box(soil, grid=0.02, height=0.1 - depth) as world:
        for _ in range(480):
            world.step()
            assert world.state("box").position[2] < 0.1 - depth
        wanted = max(depth, plate_sinkage(soil_named(soil), 0.2, 5e3))
        assert 0.1 - world.state("box").position[2] == pytest.approx(wanted, abs=1e-4)
        world.ground.soil.show()
        assert -world.terrain.tile("").heights.min() == pytest.approx(wanted, abs=1e-4)
        before = world.ground.soil.sinkage()
        world.remove("box")
        world.spawn("other", Box(0.2, 0.2, 0.2), 1.0, BodyState((2.163, 2.007, 0.1 - 0.5 * depth)))
        world.step(24)
        assert (world.ground.soil.sinkage() >= before).all()


def test_prints_stay_in_the_map_and_new_ground_is_new_soil() -> None:
    with with_box("lunar", grid=0.02) as world:
        soil = world.ground.soil
        world.step(240)
        deep = soil.sinkage().max()
        assert deep == pytest.approx(0.1 - world.state("box").position[2], abs=1e-4)
        assert soil.map.heights.min() == pytest.approx(-deep, abs=1e-6)
        pressed = (soil.map.heights < -0.5 * deep).sum() * 0.02**2
        assert pressed == pytest.approx(0.04, rel=0.2)
        world.remove("box")
        world.step(60)
        assert soil.map.heights.min() == pytest.approx(-deep, abs=1e-6)
        assert world.ground.on_soil() == {}
        soil.map.update_region(80, 80, np.full((41, 41), 0.1), time=world.time)
        world.spawn("box", Box(0.2, 0.2, 0.2), WEIGHT / 9.81, BodyState((2.003, 2.007, 0.2)))
        world.step(240)
        assert 0.2 - world.state("box").position[2] == pytest.approx(deep, rel=0.05)
        assert soil.sinkage().max() == pytest.approx(deep, rel=0.05)


@pytest.mark.parametrize("way", ["update", "restore"])
def test_soil_goes_with_its_map(way: str, caplog: pytest.LogCaptureFixture) -> None:
    """Whose place another map takes: bodies stand on that one, and the soil of a map that is no tile is refused."""
    with with_box("lunar") as world:
        soil = world.ground.soil
        world.step(240)
        world.terrain.put("", HeightMap(np.full((9, 9), 0.05), resolution=0.5))
        if way == "restore":
            world.save()
        for _ in range(240):
            world.ground.update(world.time, world.dt)
            world.client.stepSimulation()
            world.time += world.dt
        assert world.ground.soil is None
        assert world.state("box").position[2] == pytest.approx(0.15, abs=1e-3)
        assert soil.map.heights.min() < 0.0
        assert "the map of the soil is no tile any more" in caplog.text
        with pytest.raises(InputError, match="no tile"):
            world.ground.set_soil(soil)
