"""Ground that gives by its contact, rebound and rolling resistance by place, and bodies that give, by closed forms."""

import math
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as pb
import pytest

from smartmesh_ros import BodyState, Box, Cylinder, Material, Sphere, World
from smartmesh_ros.ground.shapes import Capsule, Shape
from studies.soil.trials import least
from tests.bodies import LYING, UPRIGHT, about_z, ground_of, height, put, random_turn, run
from tests.grounds import end_of, energy_of, level, shaped, world_of
from tests.urdfs import link, robot

GRAVITY, MASS, STIFFNESS = 9.81, 20.0, 2e5
RADIUS, LENGTH, SMALL = 0.2, 0.3, 0.1
RATES = [60.0, 240.0, 960.0]


MAT = Material(stiffness=STIFFNESS, damping=2e4)


def ball_volume(depth: float) -> float:
    return math.pi * depth**2 * (RADIUS - depth / 3.0)


def lying_volume(depth: float) -> float:
    rest = RADIUS - depth
    return LENGTH * (RADIUS**2 * math.acos(rest / RADIUS) - rest * math.sqrt(RADIUS**2 - rest**2))


def capsule_volume(depth: float) -> float:
    return lying_volume(depth) + ball_volume(depth)


PLATE = Box(0.4, 0.6, 0.1)
# Shape, orientation, height of its middle above the ground that it touches, and its volume below a depth.
SHAPES: list[Any] = [
    pytest.param(PLATE, UPRIGHT, 0.05, lambda d: 0.24 * d, id="plate"),
    pytest.param(PLATE, about_z(0.4), 0.05, lambda d: 0.24 * d, id="turned"),
    pytest.param(Cylinder(height=0.1, radius=RADIUS), UPRIGHT, 0.05, lambda d: math.pi * RADIUS**2 * d, id="disc"),
    pytest.param(Cylinder(height=LENGTH, radius=RADIUS), LYING, RADIUS, lying_volume, id="wheel"),
    pytest.param(Capsule(height=LENGTH, radius=RADIUS), LYING, RADIUS, capsule_volume, id="capsule"),
    pytest.param(Sphere(RADIUS), UPRIGHT, RADIUS, ball_volume, id="ball"),
]


def depth_of(volume: Any) -> float:
    """The depth at which the pressures carry the body [m]."""
    return least(lambda depth: STIFFNESS * volume(depth) >= MASS * GRAVITY, 0.0, 0.1)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("shape", "orientation", "above", "volume"), SHAPES)
def test_a_body_at_rest_sinks_until_the_pressures_carry_it(
    shape: Shape, orientation: Any, above: float, volume: Any, rate: float
) -> None:
    """Of a plate of an area A that is m g / (k A)."""
    start = BodyState((0.013, 0.027, above), orientation)
    state = end_of(level(201, material=MAT), shape, start, int(2.0 * rate), MASS, rate=rate, sleep=False)
    assert above - state.position[2] == pytest.approx(depth_of(volume), rel=0.01)
    assert np.linalg.norm(state.linear) < 1e-5


@pytest.mark.parametrize("kind", ["box", "hull"])
def test_a_plate_with_an_eccentric_mass_tilts_as_its_bed_of_springs_does(client: Any, kind: str) -> None:
    """By m g e / (k I - m g z), with the second moment of area I and the height z of the mass above the plate's
    underside, whose tilt moves it outwards; the pressures are above zero everywhere."""
    off = 0.03
    shape = client.createCollisionShape(**PLATE.bullet())
    if kind == "hull":
        corners = [[x, y, z] for x in (-0.2, 0.2) for y in (-0.3, 0.3) for z in (-0.05, 0.05)]
        shape = client.createCollisionShape(pb.GEOM_MESH, vertices=corners)
    body = client.createMultiBody(MASS, shape, basePosition=(0.0, 0.0, 0.05), baseInertialFramePosition=(off, 0.0, 0.0))
    run(ground_of(client, level(201, material=MAT), body), 480)
    turn = client.getEulerFromQuaternion(client.getBasePositionAndOrientation(body)[1])
    margin = 1e-3 if kind == "hull" else 0.0  # by which PyBullet grows hulls
    moment = (0.6 + 2.0 * margin) * (0.4 + 2.0 * margin) ** 3 / 12.0
    weight = MASS * GRAVITY
    assert turn[1] == pytest.approx(weight * off / (STIFFNESS * moment - weight * 0.05), rel=0.01)
    assert abs(turn[0]) < 1e-4


def test_a_body_that_gives_and_ground_that_gives_are_springs_in_series(client: Any) -> None:
    """Bullet's stiffness is that of each of the four contacts."""
    own, area, body = 1.5e4, 0.24, put(client, PLATE, (0.0, 0.0, 0.05), MASS)
    client.changeDynamics(body, -1, contactStiffness=own, contactDamping=600.0)
    run(ground_of(client, level(201, material=Material(stiffness=STIFFNESS)), body), 480)
    sunk = MASS * GRAVITY * (0.25 / own + 1.0 / (STIFFNESS * area))
    assert 0.05 - height(client, body) == pytest.approx(sunk, rel=0.02)


@pytest.mark.parametrize(
    ("ground", "own", "rate"),
    [
        *((ground, 0.9, rate) for ground in (0.4, 0.8) for rate in (60.0, 240.0, 960.0)),
        *((1.0, own, 240.0) for own in (0.0, 0.2, 0.5, 0.9)),
    ],
)
def test_what_falls_rebounds_by_the_product_of_both_coefficients(ground: float, own: float, rate: float) -> None:
    for shape, above in ((Sphere(0.2), 0.2), (Box(0.3, 0.3, 0.2), 0.1), (Cylinder(radius=0.15, height=0.2), 0.1)):
        made = level(201, material=Material(restitution=ground))
        with world_of(made, rate=rate, sleep=False, restitution=own) as world:
            world.spawn("body", shape, 1.0, BodyState((0.01, 0.02, above + 1.0)))
            rising: list[float] = []
            while world.time < 0.6 + ground * own:
                world.step()
                if rising or world.state("body").linear[2] > 0.0:
                    rising.append(world.state("body").position[2] - above)
        assert max(rising, default=0.0) == pytest.approx((ground * own) ** 2, rel=0.04, abs=1e-3)


@pytest.mark.parametrize("spin", [0.0, 10.0, 30.0])
@pytest.mark.parametrize(
    ("shape", "rate", "kept"),
    [(Box(0.2, 0.2, 0.2), 960.0, 0.99), (Box(0.2, 0.2, 0.2), 240.0, 0.7), (Box(0.5, 0.2, 0.05), 240.0, 0.4)],
)
def test_what_tumbles_and_bounces_without_loss_gains_no_energy(
    shape: Box, rate: float, kept: float, spin: float
) -> None:
    """Of 12 throws without friction, for a second; ``spin`` [rad/s]. Coarse steps lose some where two ends hit."""
    rng = np.random.default_rng(1)
    with world_of(level(41, 1.0), rate=rate, sleep=False, restitution=1.0, friction=0.0) as world:
        for k in range(12):
            turn, way = tuple(random_turn(rng)), rng.normal(size=3)
            start = BodyState(
                (4.0 * (k % 4), 4.0 * (k // 4), 1.0), turn, angular=tuple(spin * way / np.linalg.norm(way))
            )
            world.spawn(f"{k}", shape, 1.0, start)
        before = np.array([energy_of(world, name) for name in world.bodies])
        world.step(int(rate))
        after = np.array([energy_of(world, name) for name in world.bodies])
        assert np.all(after < 1.002 * before) and np.all(after > kept * before)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(
    ("shape", "orientation", "inertia"),
    [(Sphere(RADIUS), UPRIGHT, 0.4), (Cylinder(height=LENGTH, radius=RADIUS), LYING, 0.5)], ids=["ball", "wheel"],
)  # fmt: skip
@pytest.mark.parametrize("mass", [1.0, 300.0])
def test_what_rolls_coasts_down_by_the_coefficient(
    shape: Shape, orientation: Any, inertia: float, mass: float, rate: float
) -> None:
    """v^2 (1 + I / m r^2) / (2 c g), whatever its mass and heading, and stays where it came to rest."""
    rolling, speed, heading = 0.03, 1.5, 0.0 if isinstance(shape, Cylinder) else 0.3
    along = np.array([math.cos(heading), math.sin(heading), 0.0])
    spin = np.cross([0.0, 0.0, 1.0], along) * speed / RADIUS
    ground = level(201, material=Material(rolling=rolling))
    start = BodyState((0.0, 0.0, RADIUS), orientation, tuple(speed * along), tuple(spin))
    with world_of(ground, rate=rate, sleep=False, friction=0.8) as world:
        world.spawn("body", shape, mass, start)
        world.step(int(12.0 * rate))
        there = np.array(world.state("body").position)
        assert there @ along == pytest.approx(speed**2 * (1.0 + inertia) / (2.0 * rolling * GRAVITY), rel=0.02)
        world.step(int(2.0 * rate))
        assert np.linalg.norm(world.state("body").position - there) < 1e-3


def test_a_ball_that_also_spins_about_the_upright_rolls_straight_on_and_keeps_its_spin() -> None:
    start = BodyState((0.0, 0.0, RADIUS), linear=(1.0, 0.0, 0.0), angular=(0.0, 1.0 / RADIUS, 20.0))
    plain = replace(start, angular=(0.0, 1.0 / RADIUS, 0.0))
    ground = level(201, material=Material(rolling=0.03))
    ways = [end_of(ground, Sphere(RADIUS), state, 480, sleep=False) for state in (start, plain)]
    np.testing.assert_allclose(ways[0].position, ways[1].position, rtol=0.0, atol=1e-9)
    assert ways[0].angular[2] == pytest.approx(20.0, abs=1e-9)


@pytest.mark.parametrize(("slope", "rolls"), [(0.02, False), (0.04, True)])
def test_a_ball_on_a_slope_is_held_below_the_coefficient_alone(slope: float, rolls: bool) -> None:
    ground = shaped(lambda x, y: -slope * x, material=Material(rolling=0.03))
    start = BodyState((0.0, 0.0, math.hypot(0.1, 0.1 * slope)))
    way = end_of(ground, Sphere(0.1), start, 480, sleep=False).position[0]
    expected = 0.5 * (slope - 0.03) * GRAVITY / 1.4 * 2.0**2 if rolls else 0.0
    assert way == pytest.approx(expected, rel=0.03, abs=1e-3)


@pytest.mark.parametrize("share", [0.3, 0.65, 0.9])
def test_a_block_sinks_into_soft_ground_by_more_than_half_of_its_height(share: float) -> None:
    """It is not below the ground, and nothing lifts it."""
    stiffness = MASS * GRAVITY / (0.8 * 0.8 * 0.2 * share)
    with World(level(201, material=Material(stiffness=stiffness, damping=0.3 * stiffness))) as world:
        world.spawn("block", Box(0.8, 0.8, 0.2), MASS, BodyState((0.0, 0.0, 0.1)))
        world.step(1200)
        assert 0.1 - world.state("block").position[2] == pytest.approx(0.2 * share, rel=0.02)
        assert world.rescues == 0 and not world.below_ground()


def test_a_mat_beside_hard_ground() -> None:
    """Stiffness by place, NaN = rigid; what sleeps there wakes as it is laid."""
    with World(level(201, material=Material())) as world:
        for name, x in (("west", -1.0), ("east", 1.0)):
            world.spawn(name, PLATE, MASS, BodyState((x, 0.0, 0.05)))
        world.step(480)
        assert world.is_asleep("west") and world.is_asleep("east")
        tile: Any = world.terrain.tile("")
        stiffness = np.full((201, 201), np.nan)
        stiffness[:, :100] = STIFFNESS
        tile.material = Material(stiffness=stiffness, damping=2e4)
        world.step(480)
        assert 0.05 - world.state("west").position[2] == pytest.approx(MASS * GRAVITY / (0.24 * STIFFNESS), rel=0.02)
        assert abs(0.05 - world.state("east").position[2]) < 1e-4


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("is_rigid", [False, True])
@pytest.mark.parametrize("rise", [0.0, 0.5])
def test_a_soft_body_sinks_by_weight_over_stiffness_and_as_its_damping_says(
    client: Any, rate: float, is_rigid: bool, rise: float
) -> None:
    """Also into ground that rises [m/s], and deeper than what Bullet corrects apart from forces."""
    client.setTimeStep(1.0 / rate)
    for stiffness, share in ((10000.0, 0.1), (150.0, 1.5)):
        surface, start, first = level(), 1.0 / 60.0, rise / 60.0
        surface.replace(np.full(surface.heights.shape, first), time=start)
        ball = put(client, Sphere(SMALL), (0.01, 0.02, SMALL + first), useMaximalCoordinates=is_rigid)
        damping = share * stiffness
        client.changeDynamics(ball, -1, contactStiffness=stiffness, contactDamping=damping, linearDamping=0.0)
        client.resetBaseVelocity(ball, (0.0, 0.0, rise))
        sunk = []
        with closing(ground_of(client, surface, ball)) as ground:
            for step in range(round(4.0 * share * rate)):
                time = start + step / rate
                if step * 60 % rate < 60:
                    surface.replace(np.full(surface.heights.shape, rise * time), time=time)
                ground.step(time, 1.0 / rate)
                sunk.append(SMALL + rise * (time + 1.0 / rate) - height(client, ball))
        client.removeBody(ball)
        times, rest = np.arange(1, len(sunk) + 1) / rate, GRAVITY / stiffness
        law = rest * (1.0 - np.exp(-times / share))  # the inertia of the ball hardly counts
        error = 0.01 + 0.5 / (rate * share)  # of the implicit Euler method
        assert sunk == pytest.approx(law.tolist(), abs=error * rest)


def test_a_robots_foot_is_as_soft_as_its_description_says() -> None:
    contact = '<contact><stiffness value="2000"/><damping value="200"/></contact>'
    end = end_of(level(), robot(link("foot", mass=2.0, more=contact)), BodyState((0.0, 0.0, SMALL)), 480)
    assert SMALL - end.position[2] == pytest.approx(2.0 * GRAVITY / 2000.0, abs=2e-5)
