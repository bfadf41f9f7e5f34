"""Bodies partly on soil, partly on other ground: tiles, meshes and decks."""

import math

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, HeightMap, Sphere, World
from smartmesh_ros.ground.shapes import Cylinder, Shape
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from studies.soil.vehicles import BELOW, WHEELS, Cart
from tests.bodies import LYING, UPRIGHT, Turn, rotation
from tests.core import mesh_parts
from tests.grounds import on_soil, terrain_of
from tests.soil.test_leaning import most_gained

G = 9.81


def soil_and(soil: str = "dry_sand", rate: float = 240.0, **tiles: MainMesh | Deck) -> World:
    """Soil on the square from 0 to 2 m, and other tiles."""
    ground = HeightMap(np.zeros((51, 51)), resolution=0.04)
    return on_soil(terrain_of(**{"": ground}, **tiles), soil, rate=rate)


def pad(height: float = 0.0) -> HeightMap:
    """Rigid ground that goes on from the soil, at a height [m]."""
    return HeightMap(np.full((51, 51), height), resolution=0.04, origin=(2.0, 0.0))


@pytest.mark.parametrize("x", [1.9, 1.97, 2.0])
@pytest.mark.parametrize("is_deck", [False, True])
def test_a_box_astride_rests_on_both_and_leans_towards_the_soil(x: float, is_deck: bool) -> None:
    with soil_and(pad=Deck(pad()) if is_deck else pad()) as world:
        world.spawn("box", Box(0.3, 0.2, 0.1), 10.0, BodyState((x, 1.003, 0.06)))
        world.step(480)
        start = world.state("box").position
        world.step(480)
        assert world.state("box").position == pytest.approx(start, abs=1e-5)
        assert rotation(world.state("box").orientation)[2, 2] > math.cos(math.radians(1.5))
        rigid = sum(contact.normal_force for contact in world.contacts() if contact.position[0] > 1.999)
        soft = sum(support.carried for support in world.ground.on_soil().values())
        assert 0.0 < rigid < 10.1 * G
        assert rigid + soft == pytest.approx(10.0 * G, rel=0.01)


def test_queries_of_pybullet_change_nothing_of_what_comes_to_rest_on_both() -> None:
    """Nor do its own saved states, after which no contact is told twice."""
    runs = []
    for asks in (False, True):
        with soil_and(pad=pad()) as world:
            world.spawn("box", Box(0.3, 0.2, 0.1), 10.0, BodyState((1.93, 1.003, 0.09), linear=(0.4, 0.1, 0.0)))
            places = []
            for step in range(240):
                world.step()
                places.append(world.state("box").position)
                if not asks or step % 10:
                    continue
                world.client.performCollisionDetection()
                own, count = world.client.saveState(), len(world.client.getContactPoints())
                world.client.restoreState(own)
                assert len(world.client.getContactPoints()) == count
            runs.append(places)
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-6)


def test_a_save_does_not_move_what_rests_on_both() -> None:
    with soil_and(pad=pad()) as world:
        world.spawn("box", Box(0.3, 0.2, 0.1), 10.0, BodyState((1.93, 1.003, 0.06)))
        world.step(240)
        world.save()
        for _ in range(10):
            world.step()
            assert world.state("box").linear == pytest.approx((0.0, 0.0, 0.0), abs=2e-4)


def test_a_cart_drives_from_soil_onto_rigid_ground_and_back_without_a_kick() -> None:
    cart = Cart()
    with soil_and(pad=pad()) as world:
        world.spawn_robot("cart", cart.urdf, BodyState((1.3, 1.003, cart.radius + BELOW)))
        for direction in (1.0, -1.0):
            ways = []
            for step in range(840):
                for name in WHEELS:
                    world.drive("cart", f"{name}_axle", direction * 3.6 * min(step / 120.0, 1.0), 200.0)
                world.step()
                ways.append((*world.state("cart").linear, world.state("cart").position[1]))
            speeds = np.abs(np.array(ways)[240:, :3])
            assert speeds[:, 0].min() > 0.15  # of 0.36 m/s
            assert speeds[:, 1:].max() < 0.2  # out of a rut, a rim climbs onto the edge
            assert ways[-1][3] == pytest.approx(1.003, abs=0.01)
        assert world.rescues == 0


@pytest.mark.parametrize("rate", [60.0, 240.0])
@pytest.mark.parametrize("heights", [[], [-0.05]])
@pytest.mark.parametrize("shape", [Cylinder(radius=0.1, height=0.1), Cylinder(radius=0.2, height=0.04), Sphere(0.1)])
def test_the_edge_of_soil_gives_no_energy_to_what_rolls_over_it(
    shape: Cylinder | Sphere, heights: list[float], rate: float
) -> None:
    """It has sunk below the samples of the map at the edge, beside lower ground or none."""
    radius, mass = shape.radius, 20.0
    with soil_and("sandy_loam", rate, **{f"tile_{z}": pad(z) for z in heights}) as world:
        start = BodyState((1.8, 1.003, radius), LYING, (1.0, 0.0, 0.0), (0.0, 1.0 / radius, 0.0))
        world.spawn("wheel", shape, mass, start)
        assert most_gained(world, "wheel", round(0.6 * rate)) < 0.005 * mass
        assert world.state("wheel").position[0] > 2.0 + radius


def test_soil_that_is_higher_than_a_body_is_a_wall() -> None:
    with soil_and(low=pad(-0.5)) as world:
        world.spawn("ball", Sphere(0.1), 5.0, BodyState((2.3, 1.003, -0.4), linear=(-1.0, 0.0, 0.0)))
        world.step(120)
        assert world.state("ball").position[0] > 2.09
        assert world.ground.soil.sinkage().max() == 0.0


def test_a_ball_rests_on_a_rock_that_lies_on_the_soil() -> None:
    rock = TriangleMesh(*mesh_parts.box((0.9, 0.9, -0.1), (1.1, 1.1, 0.1)))
    with soil_and(rock=rock) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((1.003, 1.007, 0.25)))
        world.step(240)
        assert world.state("ball").position == pytest.approx((1.003, 1.007, 0.2), abs=1e-3)


@pytest.mark.parametrize("is_larger", [False, True])
@pytest.mark.parametrize(
    ("shape", "x", "height"),
    [(Sphere(0.1), 1.0, 0.1), (Box(0.2, 0.2, 0.1), 1.0, 0.05), (Box(0.3, 0.2, 0.1), 0.85, 0.05)],
)
def test_a_tile_that_fills_a_hole_of_the_soil_bears_what_is_on_it(
    shape: Shape, x: float, height: float, is_larger: bool
) -> None:
    heights = np.zeros((51, 51))
    heights[20:31, 20:31] = np.nan  # from 0.8 to 1.2 m; the cells around have no soil either
    ground = HeightMap(heights, resolution=0.04)
    side, corner = (51, 0.0) if is_larger else (11, 0.8)
    fill = HeightMap(np.zeros((side, side)), resolution=0.04, origin=(corner, corner))
    with on_soil(terrain_of(**{"": ground}, fill=fill), "dry_sand") as world:
        world.spawn("body", shape, 10.0, BodyState((x, 1.003, height + 0.05)))
        world.step(240)
        assert world.state("body").position == pytest.approx((x, 1.003, height), abs=2e-3)
        assert world.rescues == 0


@pytest.mark.parametrize("end", [1.6, 2.0])
@pytest.mark.parametrize(
    ("shape", "turn", "half"),
    [
        (Sphere(0.15), UPRIGHT, 0.15),
        (Cylinder(radius=0.15, height=0.1), LYING, 0.15),
        (Box(0.2, 0.2, 0.1), UPRIGHT, 0.05),
    ],
)
def test_what_comes_out_of_its_rut_meets_a_step_before_it_is_inside(
    shape: Shape, turn: Turn, half: float, end: float
) -> None:
    """The step stands where the soil ends, at its edge or at a hole, and is as high as the rut is deep."""
    heights = np.zeros((51, 51))
    if end < 2.0:
        heights[:, 41:46] = np.nan  # from 1.6 to 1.84 m
    rigid = HeightMap(np.zeros((51, 101)), resolution=0.04) if end < 2.0 else pad()
    with on_soil(terrain_of(**{"": HeightMap(heights, resolution=0.04)}, rigid=rigid), "dry_sand") as world:
        world.spawn("body", shape, 30.0, BodyState((end - 0.25, 1.003, half), orientation=turn))
        world.step(60)
        assert world.state("body").position[2] < half - 0.005
        depths = []
        for _ in range(240):
            falls = world.state("body").linear[2]
            world.client.resetBaseVelocity(world.body("body").uid, (0.3, 0.0, falls), (0.0, 0.0, 0.0))
            world.step()
            depths += [contact.depth for contact in world.contacts()]
        assert max(depths) < 1e-3
