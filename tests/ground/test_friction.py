"""Friction of the ground by place: ice beside gravel."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, HeightMap, Terrain, World
from smartmesh_ros.ground.shapes import Capsule, Cylinder, Shape
from tests.bodies import about_z, random_turn, rotation
from tests.grounds import shaped, terrain_of, world_of

GRAVITY = 9.81
ROWS, COLUMNS = 41, 201
FLAT = np.zeros((ROWS, COLUMNS))
ICE, GRAVEL = 0.1, 0.6
HALVES = np.where(np.arange(COLUMNS) < COLUMNS // 2, ICE, GRAVEL) + FLAT  # ice where x < 0


def flat(friction: float | np.ndarray | None = 1.0, x: float = -10.0) -> HeightMap:
    return HeightMap(FLAT, resolution=0.1, origin=(x, -2.0), friction=friction)


def sliding(terrain: HeightMap | Terrain, x: float, speed: float, friction: float = 1.0) -> World:
    world = world_of(terrain, friction=friction)
    world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((x, 0.0, 0.1), linear=(speed, 0.0, 0.0)))
    return world


def replaced() -> HeightMap:
    """Ice whose heights were replaced."""
    ground = flat(ICE)
    ground.replace(FLAT, time=0.0)
    return ground


UNKNOWN = np.where(HALVES == ICE, np.nan, HALVES)


@pytest.mark.parametrize(
    ("terrain", "x", "speed", "own", "mu"),
    [
        (flat(HALVES), -9.0, 3.0, 1.0, ICE),
        (flat(HALVES), 1.0, 3.0, 1.0, GRAVEL),
        (flat(0.6), -8.0, 2.0, 0.7, 0.42),
        (flat(UNKNOWN), -5.0, 2.0, 0.5, 0.5),
        (terrain_of(ice=flat(ICE), plain=flat(None, 10.1)), 12.0, 2.0, 0.5, 0.5),
        (replaced(), -9.0, 2.0, 1.0, ICE),
        (terrain_of(floor=shaped(lambda x, y: -1.0, 201), deck=Deck(flat(ICE))), -9.0, 2.0, 1.0, ICE),
    ],
    ids=["ice", "gravel", "of both", "unknown samples", "a tile without friction", "replaced heights", "a deck of ice"],
)
def test_a_box_stops_where_the_friction_of_its_place_stops_it(
    terrain: HeightMap | Terrain, x: float, speed: float, own: float, mu: float
) -> None:
    with sliding(terrain, x, speed, own) as world:
        world.step(round(1.2 * 240 * speed / (mu * GRAVITY)))
        state = world.state("box")
    assert abs(state.linear[0]) < 1e-4
    assert state.position[0] - x == pytest.approx(speed**2 / (2 * mu * GRAVITY), rel=0.02)


def test_across_the_border_the_normal_force_does_not_jump() -> None:
    forces = []
    with sliding(flat(HALVES), -1.0, 3.0) as world:
        for step in range(120):
            world.step()
            if step > 10:
                forces.append(sum(contact.normal_force for contact in world.contacts()))
        assert world.state("box").position[0] > 0.2
    np.testing.assert_allclose(forces, GRAVITY, rtol=0.02)


def test_coefficients_change_by_assignment_alone() -> None:
    given = HALVES.copy()
    terrain = flat(given)
    given[:] = -1.0
    assert terrain.friction == pytest.approx(HALVES)
    with pytest.raises(ValueError, match="read-only"):
        terrain.friction[:] = ICE
    terrain.friction = np.float32(0.5)
    assert terrain.friction == 0.5


@pytest.mark.parametrize("how", ["assigned", "replaced", "put"])
@pytest.mark.parametrize(("friction", "slides"), [(0.1, True), (1.0, False)])
def test_what_sleeps_on_a_slope_that_freezes_wakes_and_slides(how: str, friction: float, slides: bool) -> None:
    """And sleeps on where the friction is the one that it fell asleep on."""
    ground = shaped(lambda x, y: 0.2 * x, friction=1.0)
    with world_of(ground, friction=0.8) as world:
        world.spawn("box", Box(0.4, 0.4, 0.1), 1.0, BodyState((0.0, 0.0, 0.06)))
        world.step(600)
        assert world.is_asleep("box")
        before = world.state("box").position[0]
        if how == "assigned":
            ground.friction = friction
        elif how == "replaced":
            ground.replace(ground.heights, time=world.time, friction=friction)
        else:
            new = HeightMap(ground.heights, geometry=ground.geometry, time=world.time, friction=friction)
            world.terrain.put("", new)
        world.step()
        assert world.is_asleep("box") != slides
        world.step(120)
        assert (world.state("box").position[0] < before - 0.1) == slides


@pytest.mark.parametrize("spin", [0.0, 4.0])
@pytest.mark.parametrize("heading", [0.0, 0.4, math.pi / 4])
def test_friction_of_each_contact_that_slips_is_on_the_cone_and_against_the_slip(heading: float, spin: float) -> None:
    with world_of(flat(), friction=0.5, sleep=False) as world:
        linear = (2.0 * math.cos(heading), 2.0 * math.sin(heading), 0.0)
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 0.1), linear=linear, angular=(0.0, 0.0, spin)))
        world.step(4)
        for _ in range(48):
            world.step()
            state, box = world.state("box"), world.bodies["box"].uid
            for point in world.client.getContactPoints(box):
                sign = 1.0 if point[1] == box else -1.0
                friction = sign * (point[10] * np.array(point[11]) + point[12] * np.array(point[13]))
                slip = np.array(state.linear) + np.cross(state.angular, np.array(point[5]) - state.position)
                assert np.linalg.norm(friction) == pytest.approx(0.5 * point[9], rel=1e-3, abs=1e-6)
                assert friction == pytest.approx(-0.5 * point[9] * slip / np.linalg.norm(slip), abs=0.03 * point[9])


@pytest.mark.parametrize(
    "shape", [Capsule(height=0.2, radius=0.1), Cylinder(height=0.2, radius=0.12), Box(0.4, 0.28, 0.2)]
)
def test_in_an_impact_what_slips_on_has_all_friction_of_the_cone(shape: Shape) -> None:
    """Bodies that tumble, at impacts of one contact; the solver leaves some slip, also on PyBullet's plane."""
    rng, impacts = np.random.default_rng(1), 0
    for _ in range(40):
        with world_of(shaped(lambda x, y: 0.0), friction=0.6) as world:
            turn, (vx, vy) = tuple(random_turn(rng)), rng.uniform(-2.0, 2.0, 2)
            at, spin = (0.0, 0.0, rng.uniform(0.5, 0.6)), tuple(rng.normal(size=3) * 2.0)
            world.spawn("body", shape, 1.0, BodyState(at, turn, (vx, vy, 0.0), spin))
            for _ in range(120):
                world.step()
                state, body = world.state("body"), world.bodies["body"].uid
                points = [point for point in world.client.getContactPoints(body) if point[9] > 120.0]
                if len(points) != 1:
                    continue
                impacts += 1
                [(_, first, _, _, _, on_body, on_other, _, _, force, one, along, other, across, *_)] = points
                at = np.array(on_body if first == body else on_other)
                slip = (np.array(state.linear) + np.cross(state.angular, at - state.position))[:2]
                used = np.linalg.norm(one * np.array(along) + other * np.array(across)) / (0.6 * force)
                assert used > 0.9 or np.linalg.norm(slip) < 0.3
    assert impacts > 40


@pytest.mark.parametrize("share", [1.0, 0.3, 0.0])
def test_along_an_axis_of_a_box_its_anisotropic_friction_is_that_share_of_all(share: float) -> None:
    speed, way = 2.0, rotation(about_z(0.4))[:, 0]
    with world_of(flat(), friction=0.5) as world:
        world.spawn("sled", Box(0.4, 0.3, 0.1), 1.0, BodyState((0.0, 0.0, 0.05), about_z(0.4), tuple(speed * way)))
        world.client.changeDynamics(world.bodies["sled"].uid, -1, anisotropicFriction=(share, 1.0, 1.0))
        world.step(48)
        assert world.state("sled").linear == pytest.approx((speed - 0.2 * share * 0.5 * GRAVITY) * way, abs=0.03)


@pytest.mark.parametrize("heading", [0.0, 0.5, math.pi / 4])
def test_a_box_at_rest_on_a_slope_stays_exactly_there(heading: float) -> None:
    """Where the solver does not end early, friction that takes its direction from the last step does not creep."""
    rise = math.tan(math.radians(20.0))
    ground = shaped(lambda x, y: rise * (x * math.cos(heading) + y * math.sin(heading)))
    with world_of(ground, friction=0.5, sleep=False, solver_residual=0.0) as world:
        world.spawn("box", Box(0.4, 0.3, 0.2), 1.0, BodyState((0.0, 0.0, 0.25)))
        world.step(480)
        before = np.array(world.state("box").position)
        world.step(2400)
        assert np.array(world.state("box").position) == pytest.approx(before, abs=2e-6)
