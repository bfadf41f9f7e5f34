"""Decks ride on frames with all six degrees of freedom: bodies meet them as they meet ground at rest."""

import copy
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import BodyState, Box, Deck, Ground, HeightMap, HeightScan, Sphere, World
from smartmesh_ros.ground.quaternions import quaternion_of
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.driving import Carrier
from tests.bodies import rotation
from tests.core import mesh_parts
from tests.grounds import level, terrain_of, world_of

DT, G = 1.0 / 240.0, 9.81
BOX = Box(0.5, 0.4, 0.3)
OMEGA = math.tau / 8.0  # of a ship's motion [rad/s]


class Ship(NamedTuple):
    """A ship that surges, heaves, rolls and pitches about a place 2 m above the origin."""

    heave: float = 0.5
    surge: float = 0.3
    tilt: float = math.radians(10.0)
    phase: float = 0.0

    def position(self, time: float) -> FloatArray:
        wave = math.sin(OMEGA * time + self.phase)
        return np.array([self.surge * wave, 0.0, 2.0 + self.heave * wave])

    def orientation(self, time: float) -> FloatArray:
        """Roll, then pitch a quarter of a period later (x, y, z, w)."""
        roll = 0.5 * self.tilt * math.sin(OMEGA * time + self.phase)
        pitch = 0.5 * self.tilt * math.cos(OMEGA * time + self.phase)
        a, b, c, d = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
        return np.array([a * d, b * c, -a * c, b * d])

    def move(self, deck: Deck, time: float) -> None:
        deck.move(self.position(time), self.orientation(time), time=time)

    def to_deck(self, point: Any, time: float) -> FloatArray:
        return np.asarray((np.asarray(point) - self.position(time)) @ rotation(self.orientation(time)))

    def to_world(self, point: FloatArray, time: float) -> FloatArray:
        return np.asarray(rotation(self.orientation(time)) @ point + self.position(time))

    def velocity(self, point: FloatArray, time: float) -> FloatArray:
        """Of a point of the deck's frame, by central differences [m/s]."""
        return np.asarray((self.to_world(point, time + 1e-4) - self.to_world(point, time - 1e-4)) / 2e-4)

    def spin(self, time: float) -> FloatArray:
        """Angular velocity by central differences [rad/s]."""
        after, before = (rotation(self.orientation(time + by)) for by in (1e-4, -1e-4))
        skew = (after - before) / 2e-4 @ rotation(self.orientation(time)).T
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    def state(self, point: FloatArray, time: float) -> BodyState:
        """Of a body that is fixed to a point of the deck."""
        pose = tuple(self.to_world(point, time)), tuple(self.orientation(time))
        return BodyState(*pose, tuple(self.velocity(point, time)), tuple(self.spin(time)))


def a_map() -> HeightMap:
    return level(21, 0.25)


def a_mesh() -> TriangleMesh:
    return TriangleMesh(*mesh_parts.sheet(5.0, 20))


def on_deck(deck: Deck, **physics: Any) -> World:
    """A world of level ground with a deck above it."""
    return world_of(terrain_of(sea=level(11, 2.0), deck=deck), **physics)


def with_bridge(**physics: Any) -> World:
    """A world of level ground with a bridge of 4 m, 2 m above it and 0.3 m thick."""
    bridge = Deck(level(9, 0.5), thickness=0.3, position=(0.0, 0.0, 2.0))
    return world_of(terrain_of(road=level(21, 0.5), bridge=bridge), **physics)


@pytest.mark.parametrize(("mesh", "is_tracked"), [(a_map, False), (a_mesh, False), (a_map, True)])
def test_a_box_at_rest_rides_on_a_deck_that_rolls_pitches_and_heaves(
    mesh: Callable[[], MainMesh], is_tracked: bool
) -> None:
    """Told at 60 Hz where the deck is, or where a tracked body is that carries it and has its velocity."""
    ship, place, deck = Ship(), np.array([1.0, 0.5, 0.15]), Deck(mesh())
    with on_deck(deck, friction=0.8) as world:
        if is_tracked:
            world.carry("deck", Carrier("ship"))
        world.spawn("box", BOX, 1.0, ship.state(place, 0.0))
        found = []
        for step in range(960):
            if step % 4 == 0 and is_tracked:
                world.track("ship", 0.05, ship.state(np.zeros(3), world.time))
            elif step % 4 == 0:
                ship.move(deck, world.time)
            world.step()
            found.append(ship.to_deck(world.state("box").position, world.time))
    later = np.array(found)[120:]  # once four poses tell how the deck moves
    assert np.abs(later[:, 2] - 0.15).max() < (2e-3 if is_tracked else 1e-4)
    assert np.linalg.norm(later[:, :2] - later[0, :2], axis=1).max() < (2e-3 if is_tracked else 1e-3)  # of a way of 1 m


def test_a_deck_is_as_thick_as_it_is_and_may_become_thinner() -> None:
    """Balls on a bridge, below it and inside it, and a box that jumps until its top is above it."""
    with with_bridge() as world:
        world.spawn("above", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 2.5)))
        world.spawn("below", Sphere(0.2), 1.0, BodyState((1.0, 0.0, 0.5)))
        speed = math.sqrt(2.0 * G * 1.1)
        world.spawn("jumps", Box(1.0, 1.0, 1.0), 1.0, BodyState((-1.0, 1.0, 0.5), linear=(0.0, 0.0, speed)))
        world.step(100)
        flight = 0.5 + speed * 100 * DT - 0.5 * G * DT**2 * 100 * 101
        assert world.state("jumps").position[2] == pytest.approx(flight, abs=1e-9)
        world.step(380)
        heights = [world.state(name).position[2] for name in ("above", "below")]
        assert heights == pytest.approx([2.2, 0.2], abs=1e-4)
        assert world.rescues == 0
        assert world.patches().table().tiles == ["bridge", "road", "road"]
        world.spawn("inside", Sphere(0.2), 1.0, BodyState((-1.0, 0.0, 1.9)))
        world.step(240)
        assert world.state("inside").position[2] == pytest.approx(2.2, abs=1e-4)
        world.terrain.deck("bridge").thickness = 0.05
        world.spawn("no more inside", Sphere(0.1), 1.0, BodyState((-1.0, -1.0, 1.8)))
        world.step(10)
        assert world.state("no more inside").position[2] < 1.8
        assert world.rescues == 1


@pytest.mark.parametrize("shape", [Sphere(0.2), Box(0.4, 0.4, 0.4)], ids=["ball", "box"])
def test_the_walls_of_a_deck_are_as_high_as_it_is_thick(shape: Shape) -> None:
    """Bodies fly towards the rim of a bridge: below its wall they pass, at its wall they stop."""
    with with_bridge(gravity=(0.0, 0.0, 0.0), friction=0.0) as world:
        for name, y, z in (("below", -1.0, 1.4), ("at the wall", 1.0, 1.9)):
            world.spawn(name, shape, 1.0, BodyState((3.0, y, z), linear=(-2.0, 0.0, 0.0)))
        world.step(240)
        assert world.state("below").position == pytest.approx((1.0, -1.0, 1.4), abs=1e-6)
        assert world.state("at the wall").position[0] == pytest.approx(2.2, abs=1e-3)


def cabin() -> TriangleMesh:
    """A closed room of 2 m, whose inner sides count."""
    return TriangleMesh(*mesh_parts.flipped(mesh_parts.box((-1, -1, 0), (1, 1, 2))))


@pytest.mark.parametrize("thickness", [math.inf, 0.1])
def test_a_cabin_that_rises_carries_what_is_inside_and_holds_it_back_at_its_roof(thickness: float) -> None:
    deck = Deck(cabin(), thickness=thickness)
    with on_deck(deck) as world:
        world.spawn("rests", Sphere(0.1), 1.0, BodyState((0.4, 0.2, 0.1)))
        world.spawn("jumps", Sphere(0.1), 1.0, BodyState((-0.4, 0.2, 0.1), linear=(0.0, 0.0, 9.0)))
        for _ in range(480):
            deck.move((0.0, 0.0, 0.5 * world.time), time=world.time)
            world.step()
            assert world.state("jumps").position[2] < 1.9 + 0.5 * world.time + 1e-3
        heights = [world.state(name).position[2] for name in ("rests", "jumps")]
        assert heights == pytest.approx([1.1, 1.1], abs=1e-3)
        assert world.rescues == 0


@pytest.mark.parametrize("tilt", [0.0, 0.2])
@pytest.mark.parametrize("thickness", [0.5, math.inf])
def test_a_map_of_a_deck_is_solid_as_far_down_as_the_deck_is_thick(thickness: float, tilt: float) -> None:
    """Between the storeys of a mesh of the same deck: a ball that is deeper falls onto the lower one."""
    ship, depths = Ship(tilt=tilt), np.array([0.1, 0.25, 0.45, 0.7])
    deck = Deck(a_map(), thickness=thickness, position=ship.position(0.0), orientation=ship.orientation(0.0))
    sheet, triangles = mesh_parts.sheet(5.0, 10)
    storeys = mesh_parts.joined((sheet + [0.0, 0.0, 1.0], triangles), (sheet - [0.0, 0.0, 1.0], triangles))
    deck.put("storeys", TriangleMesh(*storeys))
    with on_deck(deck) as world:
        for name, depth in enumerate(depths):
            place = np.array([0.5 * name - 1.0, 0.0, -depth])
            world.spawn(str(name), Sphere(0.2), 1.0, BodyState(tuple(ship.to_world(place, 0.0))))
        world.step(120)
        heights = [ship.to_deck(world.state(name).position, 0.0)[2] for name in world.bodies]
    assert heights == pytest.approx(np.where(depths < thickness, 0.2, -0.8), abs=1e-3)


def test_a_ball_that_is_thrown_at_a_deck_upside_down_stays_below_it() -> None:
    deck = Deck(a_map(), thickness=0.3, position=(0.0, 0.0, 2.0), orientation=(1.0, 0.0, 0.0, 0.0))
    with on_deck(deck) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.1, 0.1, 0.5), linear=(0.0, 0.0, 6.0)))
        highest = 0.0
        for _ in range(240):
            world.step()
            highest = max(highest, world.state("ball").position[2])
        assert highest == pytest.approx(1.9, abs=1e-2)
        assert world.rescues == 0


def test_queries_rays_and_scans_see_a_deck_where_it_is_at_an_instant(client: Any) -> None:
    ship, rng, time = Ship(), np.random.default_rng(2), 1.3
    terrain = terrain_of(sea=level(11, 2.0), deck=(deck := Deck(a_map())))
    for at in time - DT * np.arange(4.0)[::-1]:
        ship.move(deck, at)
    ground, origin, normal = Ground(client, terrain), ship.position(time), rotation(ship.orientation(time))[:, 2]
    xy = rng.uniform(-1.5, 1.5, (20, 2))
    found = ground.at(xy, time)
    assert found.z == pytest.approx(origin[2] - ((xy - origin[:2]) @ normal[:2]) / normal[2], abs=1e-9)
    assert found.normals == pytest.approx(np.tile(normal, (20, 1)), abs=1e-9)
    points = np.column_stack([xy, found.z])
    speeds = [ship.velocity(ship.to_deck(point, time), time) for point in points]
    assert found.velocities == pytest.approx(np.array(speeds), abs=2e-4)
    assert ground.at(np.column_stack([xy, np.full(20, 1.0)]), time).z == pytest.approx(0.0)
    hits = ground.cast_rays(points + [0.0, 3.0, 4.0], np.tile([0.0, -0.6, -0.8], (20, 1)), 20.0, time)
    assert hits.distances == pytest.approx(5.0, abs=1e-9)
    over = origin[2] + (origin[:2] @ normal[:2]) / normal[2]
    assert terrain.at([[8.0, 8.0], [0.0, 0.0]], time).heights == pytest.approx([0.0, over], abs=1e-9)
    scan = HeightScan(size=(1.0, 1.0), spacing=0.5).read(terrain, np.zeros((1, 4)), time)
    x, y = np.meshgrid([-0.5, 0.0, 0.5], [-0.5, 0.0, 0.5])
    assert scan[0] == pytest.approx((over - (x * normal[0] + y * normal[1]) / normal[2]).ravel(), abs=1e-6)


def test_a_box_sleeps_on_a_deck_at_rest_and_wakes_when_the_deck_moves() -> None:
    deck = Deck(a_map(), position=(0.0, 0.0, 2.0))
    with on_deck(deck) as world:
        world.spawn("box", BOX, 1.0, BodyState((0.0, 0.0, 2.15)))
        world.spawn("below", BOX, 1.0, BodyState((8.0, 0.0, 0.15)))
        world.step(480)
        assert [world.is_asleep(name) for name in world.bodies] == [True, True]
        for _ in range(60):
            deck.move((0.0, 0.0, 2.0 + 0.5 * world.time - 1.0), time=world.time)
            world.step()
        assert [world.is_asleep(name) for name in world.bodies] == [False, True]
        assert world.state("box").linear[2] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("told", [False, True])
def test_a_frame_moves_between_its_poses_to_second_order_and_stops_without_more(told: bool) -> None:
    deck, ship, errors = Deck(a_map()), Ship(), []
    for interval in (0.1, 0.05):
        deck.place(ship.position(0.0), ship.orientation(0.0), time=0.0)
        error = 0.0
        for time in np.arange(1, 30) * interval:
            if told:
                twist = {"velocity": ship.velocity(np.zeros(3), time), "spin": ship.spin(time)}
                deck.move(ship.position(time), ship.orientation(time), time=time, **twist)
            else:
                ship.move(deck, time)
            if time > 3 * interval:
                frame = deck.frame(time + interval)
                corner = frame.position + frame.rotation @ [2.5, 2.5, 0.0]
                expected = ship.to_world(np.array([2.5, 2.5, 0.0]), time + interval)
                error = max(error, float(np.linalg.norm(corner - expected)))
        errors.append(error)
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.2)
    assert deck.moving(time + 0.2) and not deck.moving(time + 0.23)
    assert (deck.frame(time + 1.0).velocity == 0.0).all()
    frames = [deck.frame(time + 1e-3 * number) for number in range(300)]
    ways, speeds = np.diff([frame.position for frame in frames], axis=0), np.array([frame.velocity for frame in frames])
    assert ways == pytest.approx(1e-3 * 0.5 * (speeds[1:] + speeds[:-1]), abs=1e-6)
    turned, spins = np.array([frame.rotation for frame in frames]), np.array([frame.spin for frame in frames])
    turns = (turned[1:] @ turned[:-1].transpose(0, 2, 1))[:, [2, 0, 1], [1, 2, 0]]
    assert turns == pytest.approx(1e-3 * 0.5 * (spins[1:] + spins[:-1]), abs=1e-6)
    assert np.abs(np.diff(speeds, axis=0)).max() < 0.02


def test_a_frame_that_stops_does_not_go_back() -> None:
    deck = Deck(a_map())
    for time in (0.0, 0.1, 0.2, 0.3, 0.4):
        deck.move((min(time, 0.3), 0.0, 0.0), time=time)
    assert deck.frame(0.45).position[0] == pytest.approx(0.3, abs=1e-12)


def test_a_pose_at_the_same_time_but_for_rounding_replaces_the_last() -> None:
    deck = Deck(a_map())
    for x, time in ((0.1, 0.1), (0.2, 0.2), (0.3, 0.3), (0.3 + 1e-14, 0.1 + 0.2)):
        deck.move((x, 0.0, 2.0), time=time)
    assert deck.frame(0.4).position == pytest.approx([0.4, 0.0, 2.0], abs=1e-9)
    assert deck.frame(0.4).velocity == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_a_copy_of_a_terrain_has_decks_of_its_own() -> None:
    terrain = terrain_of(deck=(deck := Deck(a_map())))
    for time in (0.0, 0.1, 0.2):
        Ship().move(deck, time)
    twin = copy.deepcopy(terrain)
    assert (twin.decks["deck"].frame(0.3).position == deck.frame(0.3).position).all()
    deck.place((0.0, 0.0, 9.0), time=0.3)
    assert terrain.at([[0.0, 0.0]], 0.3).heights == pytest.approx(9.0)
    assert twin.at([[0.0, 0.0]], 0.3).heights < 3.0


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1))
def test_a_frame_tells_its_orientation_as_it_was_given(numbers: tuple[float, ...]) -> None:
    turn = np.array(numbers) / math.hypot(*numbers)
    found = quaternion_of(Deck(orientation=turn).frame(0.0).rotation)
    assert abs(found @ turn) == pytest.approx(1.0, abs=1e-12)
