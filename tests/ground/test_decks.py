"""Decks ride on frames with all six degrees of freedom: bodies meet them as they meet ground at rest."""

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smartmesh_ros import (
    BodyState,
    Box,
    Deck,
    Ground,
    HeightMap,
    HeightScan,
    InputError,
    Material,
    PhysicsConfig,
    Sphere,
    Terrain,
    World,
    WorldConfig,
)
from smartmesh_ros.ground.quaternions import quaternion_of
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from smartmesh_ros.terrain.trimesh import TriangleMesh
from smartmesh_ros.world.driving import Carrier
from smartmesh_ros.world.joints import JointCommand
from tests.bodies import put, rotation
from tests.core import mesh_parts
from tests.grounds import level, terrain_of
from tests.urdfs import HUSKY, box, joint, link, robot

DT, G, PERIOD, TILT = 1.0 / 240.0, 9.81, 8.0, math.radians(10.0)
OMEGA = math.tau / PERIOD


class Motion(NamedTuple):
    """A ship that surges, heaves, rolls and pitches about a place."""

    heave: float = 0.5
    surge: float = 0.3
    tilt: float = TILT
    phase: float = 0.0
    at: tuple[float, float, float] = (0.0, 0.0, 2.0)

    def position(self, time: float) -> FloatArray:
        wave = math.sin(OMEGA * time + self.phase)
        return np.array(self.at) + [self.surge * wave, 0.0, self.heave * wave]

    def orientation(self, time: float) -> FloatArray:
        """Roll, then pitch a quarter of a period later (x, y, z, w)."""
        roll = 0.5 * self.tilt * math.sin(OMEGA * time + self.phase)
        pitch = 0.5 * self.tilt * math.cos(OMEGA * time + self.phase)
        a, b, c, d = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
        return np.array([a * d, b * c, -a * c, b * d])

    def move(self, deck: Deck, time: float) -> None:
        deck.move(self.position(time), self.orientation(time), time=time)

    def to_deck(self, point: FloatArray, time: float) -> FloatArray:
        return np.asarray((np.asarray(point) - self.position(time)) @ rotation(self.orientation(time)))

    def to_world(self, point: FloatArray, time: float) -> FloatArray:
        return np.asarray(rotation(self.orientation(time)) @ point + self.position(time))

    def velocity(self, point: FloatArray, time: float) -> FloatArray:
        """Of a point of the deck's frame, by central differences [m/s]."""
        return np.asarray((self.to_world(point, time + 1e-4) - self.to_world(point, time - 1e-4)) / 2e-4)


def a_map() -> HeightMap:
    return level(21, 0.25)


def a_mesh() -> TriangleMesh:
    return TriangleMesh(*mesh_parts.sheet(5.0, 20))


def config(**physics: float) -> WorldConfig:
    return WorldConfig(physics=PhysicsConfig(**physics))


def on_deck(deck: Deck, *, friction: float = 0.8, **physics: float) -> World:
    terrain = Terrain(level(11, 2.0))
    terrain.put("deck", deck)
    return World(terrain, config(friction=friction, **physics))


def ride(world: World, motion: Motion, steps: int, every: int = 1) -> Iterator[float]:
    """Step a world whose deck moves, told every so many steps; yields the time after each."""
    for step in range(steps):
        if step % every == 0:
            motion.move(world.terrain.decks["deck"], world.time)
        world.step()
        yield world.time


@pytest.mark.parametrize("mesh", [a_map, a_mesh])
def test_a_box_at_rest_rides_on_a_deck_that_rolls_pitches_and_heaves(mesh: Callable[[], MainMesh]) -> None:
    motion, place = Motion(), np.array([1.0, 0.5, 0.15])
    with on_deck(Deck(mesh())) as world:
        start = motion.to_world(place, 0.0)
        velocity = motion.velocity(place, 0.0)
        state = BodyState(tuple(start), tuple(motion.orientation(0.0)), linear=tuple(velocity))
        world.spawn("box", Box(0.5, 0.4, 0.3), 1.0, state)
        found = np.array(
            [motion.to_deck(world.state("box").position, now) for now in ride(world, motion, 960, every=4)]
        )
    heights = found[60:, 2] - 0.15  # once four poses tell how the deck moves
    assert np.abs(heights).max() < 1e-4
    assert np.linalg.norm(found[60:, :2] - found[60, :2], axis=1).max() < 1e-3  # of a way of 1 m


def test_a_box_slides_once_the_tangent_exceeds_the_friction() -> None:
    """The deck tilts by half a degree a second, and sliding is noticed after 0.3 mm: 0.7 % late."""
    deck, friction, rate, top = Deck(level(41, 0.25)), 0.4, math.radians(0.5), np.array([0.0, 0.0, 3.0])
    first = math.atan(friction) - math.radians(1.0)

    def turn(angle: float) -> FloatArray:
        return np.array([0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)])

    with on_deck(deck, friction=friction) as world:
        deck.place(top, turn(first), time=0.0)
        place = top + rotation(turn(first)) @ [0.0, 0.0, 0.15]
        world.spawn("box", Box(0.5, 0.4, 0.3), 1.0, BodyState(tuple(place), tuple(turn(first))))
        start = None
        for step in range(-240, 960):
            angle = first + rate * max(step, 0) * DT
            deck.move(top, turn(angle), time=world.time)
            along = float((np.array(world.state("box").position) - top) @ rotation(turn(angle))[:, 0])
            start = along if step == 0 else start
            if start is not None and along > start + 3e-4:
                break
            world.step()
        assert math.tan(angle) == pytest.approx(friction, rel=0.01)


@pytest.mark.parametrize("phase", range(8))
def test_a_ball_rebounds_with_its_restitution_in_each_phase_of_a_heaving_deck(phase: int) -> None:
    """Both flights are followed to where they meet the deck: v' = e v, relative to it."""
    motion, restitution, radius = Motion(1.0, 0.0, TILT, math.tau * phase / 8), 0.6, 0.1
    motion = motion._replace(tilt=0.0)
    with on_deck(Deck(a_map()), restitution=restitution) as world:
        start = motion.to_world(np.array([0.0, 0.0, 1.2]), 0.0)
        world.spawn("ball", Sphere(radius), 1.0, BodyState(tuple(start)))

        def meeting(before: float, after: float) -> float:
            """Speed relative to the deck where the flight of now meets it, searched from a time to another [m/s]."""
            state, now = world.state("ball"), world.time
            speed = state.linear[2] - 0.5 * G * DT  # of the parabola through the places of the steps
            times = now + np.linspace(before, after, 20001)
            deck = 2.0 + np.sin(OMEGA * times + motion.phase)
            gaps = state.position[2] - radius + speed * (times - now) - 0.5 * G * (times - now) ** 2 - deck
            first = int(np.flatnonzero(np.diff(np.sign(gaps)))[0])
            return float(speed - G * (times[first] - now) - OMEGA * math.cos(OMEGA * times[first] + motion.phase))

        closing = leaving = 0.0
        for _ in ride(world, motion, 480):
            if world.state("ball").linear[2] < 0.0 and leaving == 0.0:
                before = world.state("ball")
            gap = world.state("ball").position[2] - radius - motion.position(world.time)[2]
            if gap < 0.5 and closing == 0.0:
                closing = meeting(0.0, 0.5)
            if closing and world.state("ball").linear[2] - OMEGA * math.cos(OMEGA * world.time + motion.phase) > 0.5:
                leaving = meeting(-0.1, 0.0)
                break
        assert before.linear[2] < 0.0
        assert leaving == pytest.approx(-restitution * closing, rel=0.02)


def test_a_body_in_flight_over_a_deck_is_untouched() -> None:
    def flight(deck: Deck | None) -> BodyState:
        terrain = Terrain(level(11, 2.0))
        if deck is not None:
            terrain.put("deck", deck)
        with World(terrain) as world:
            world.spawn("box", Box(0.5, 0.4, 0.3), 1.0, BodyState((0.0, 0.0, 5.0), angular=(1.0, 2.0, 3.0)))
            for _ in range(150):
                if deck is not None:
                    Motion().move(deck, world.time)
                world.step()
            return world.state("box")

    assert flight(Deck(a_map())) == flight(None)


@pytest.mark.parametrize("shape", [Box(0.5, 0.4, 0.3), Sphere(0.2)])
def test_physics_on_a_deck_at_constant_velocity_is_that_on_ground_at_rest(shape: Shape) -> None:
    """Galilei: heights, throws and slides are the same, and the deck's turn about the vertical does not matter."""
    rng, drift, turn = np.random.default_rng(1), np.array([1.5, -0.7, 0.4]), 0.6
    heights = rng.normal(scale=0.03, size=(41, 41))
    quaternion = np.array([0.0, 0.0, math.sin(0.5 * turn), math.cos(0.5 * turn)])

    def thrown(terrain: Terrain, at: FloatArray, q: FloatArray, velocity: FloatArray) -> FloatArray:
        with World(terrain, config(restitution=0.3)) as world:
            world.spawn("body", shape, 1.0, BodyState(tuple(at), tuple(q), linear=tuple(velocity)))
            for _ in range(240):
                for deck in terrain.decks.values():
                    spin = np.zeros(3)
                    deck.move(drift * world.time, quaternion, time=world.time, velocity=drift, spin=spin)
                world.step()
            return np.array(world.state("body").position)

    start, speed = np.array([0.2, 0.3, 0.8]), np.array([1.0, 0.5, -2.0])
    at_rest = thrown(
        Terrain(HeightMap(heights, resolution=0.2, origin=(-4.0, -4.0))), start, np.array([0.0, 0.0, 0.0, 1.0]), speed
    )
    terrain, turned = Terrain(), rotation(quaternion)
    terrain.put("deck", Deck(HeightMap(heights, resolution=0.2, origin=(-4.0, -4.0))))
    moved = thrown(terrain, turned @ start, quaternion, turned @ speed + drift)
    assert turned.T @ (moved - drift * 1.0) == pytest.approx(at_rest, abs=2e-3)


def test_waves_inside_a_deck_add_to_its_own_motion() -> None:
    """A ball on waves of a map that heaves as a whole, and on the same waves in a deck that heaves instead."""
    x = np.tile(np.arange(-5.0, 5.01, 0.25), (41, 1))

    def ridden(*, as_deck: bool) -> FloatArray:
        place = {"resolution": 0.25, "origin": (-5.0, -5.0)}
        ground, terrain = HeightMap(np.zeros(x.shape), **place), Terrain()
        deck = Deck(ground)
        terrain.put("ground", deck if as_deck else ground)
        with World(terrain, config(restitution=0.2)) as world:
            world.spawn("ball", Sphere(0.2), 1.0, BodyState((0.3, 0.1, 1.0)))
            for step in range(480):
                wave, heave = 0.1 * np.sin(1.5 * x + 3.0 * world.time), 0.5 * math.sin(2.0 * world.time)
                if step % 4 == 0:
                    ground.replace(wave + (0.0 if as_deck else heave), time=world.time)
                    deck.move((0.0, 0.0, heave), time=world.time)
                world.step()
            return np.array(world.state("ball").position)

    assert ridden(as_deck=True) == pytest.approx(ridden(as_deck=False), abs=5e-3)


def test_cargo_rides_on_a_robot_that_drives_and_turns() -> None:
    terrain = Terrain(level(81, 0.5))
    terrain.put("bed", Deck(level(9, 0.1), thickness=0.2))
    with World(terrain, config(friction=0.9)) as world:
        world.spawn_robot("husky", HUSKY, BodyState((0.0, 0.0, 0.15)))
        world.carry("bed", Carrier("husky", position=(0.0, 0.0, 0.45)))
        world.spawn("cargo", Box(0.3, 0.3, 0.2), 20.0, BodyState((0.0, 0.0, 0.72)))
        world.step(240)
        for joint_name in (it.name for it in world.joints("husky") if "wheel" in it.name):
            world.command("husky", joint_name, JointCommand(velocity=4.0 if "left" in joint_name else 8.0))
        places = []
        for _ in range(480):
            world.step()
            frame = terrain.deck("bed").frame(world.time)
            places.append(frame.rotation.T @ (np.array(world.state("cargo").position) - frame.position))
        found = np.array(places)
        assert np.abs(found[:, 2] - 0.1).max() < 2e-3
        assert np.linalg.norm(found[:, :2] - found[0, :2], axis=1).max() < 0.03
        assert math.hypot(*world.state("husky").position[:2]) > 1.0


def test_a_rover_drives_from_a_rolling_deck_over_a_ramp_onto_ground_at_rest() -> None:
    """A ramp of the deck leads down to its end, which lies on the quay, on the axis about which the deck pitches."""
    x = np.arange(0.0, 6.01, 0.1)
    ramp = np.tile(np.interp(x, [0.0, 5.0, 6.0], [0.3, 0.3, 0.0]), (31, 1))
    terrain = Terrain(HeightMap(np.zeros((31, 61)), resolution=0.1, origin=(5.9, -1.5)))
    deck = Deck(HeightMap(ramp, resolution=0.1, origin=(0.0, -1.5)))
    terrain.put("deck", deck)
    with World(terrain, config(friction=1.0)) as world:

        def angle(time: float) -> FloatArray:
            roll = math.radians(3.0) * math.sin(OMEGA * time)
            return np.array([0.0, math.sin(0.5 * roll), 0.0, math.cos(0.5 * roll)])

        def move(time: float) -> None:
            turn = angle(time)
            deck.move(np.array([6.0, 0.0, 0.0]) - rotation(turn) @ [6.0, 0.0, 0.0], turn, time=time)

        move(0.0)
        world.spawn_robot("husky", HUSKY, BodyState((3.0, 0.0, 0.6)))
        wheels = [it.name for it in world.joints("husky") if "wheel" in it.name]
        climbs = []
        for step in range(1500):
            move(world.time)
            if step == 240:
                over = rotation(angle(world.time)).T @ (np.array(world.state("husky").position) - [6.0, 0.0, 0.0])
                for wheel in wheels:
                    world.command("husky", wheel, JointCommand(velocity=6.0))
            world.step()
            climbs.append(world.state("husky").linear[2])
        x, _, z = world.state("husky").position
        assert x > 8.0
        assert z == pytest.approx(over[2] - 0.3, abs=0.01)
        assert np.abs(np.diff(climbs[240:])).max() < 0.1  # m/s in a step: no jump


class Raft(NamedTuple):
    """What carries a deck in free flight: its kind, its mass [kg], and where on it a ball lands [m]."""

    multibody: bool
    mass: float
    off: float


RAFTS = (Raft(False, 2.0, 0.8), Raft(True, 2.0, 0.8), Raft(False, 10.0, 0.0), Raft(True, 0.5, 0.0))


@pytest.mark.parametrize("restitution", [0.0, 0.6])
@pytest.mark.parametrize("raft", RAFTS)
def test_a_ball_and_the_free_body_whose_deck_it_lands_on_conserve_momentum(
    client: Any, raft: Raft, restitution: float
) -> None:
    """At the end of each step; and they part with the restitution of their speed."""
    client.setGravity(0.0, 0.0, 0.0)
    size = Box(2.0, 2.0, 0.2)
    carrier = put(client, size, (0.0, 0.0, 1.0), raft.mass, useMaximalCoordinates=0 if raft.multibody else 1)
    ball = put(client, Sphere(0.1), (raft.off, 0.0, 1.8), useMaximalCoordinates=1)
    client.resetBaseVelocity(ball, (0.0, 0.0, -2.0))
    for body in (carrier, ball):
        client.changeDynamics(body, -1, restitution=restitution, lateralFriction=0.0)
        client.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
    terrain = terrain_of()
    terrain.put("deck", Deck(level(9, 0.25)))
    ground = Ground(client, terrain)
    ground.attach(ball)
    ground.carry("deck", carrier, position=(0.0, 0.0, 0.3))
    for step in range(120):
        ground.step(step * DT, DT)
        velocity, (linear, angular) = client.getBaseVelocity(ball)[0], client.getBaseVelocity(carrier)
        assert np.array(velocity) + raft.mass * np.array(linear) == pytest.approx([0.0, 0.0, -2.0], abs=1e-9)
        moment = np.array(client.getDynamicsInfo(carrier, -1)[2])
        spin = np.cross(client.getBasePositionAndOrientation(ball)[0], velocity)
        spin = spin + raft.mass * np.cross(client.getBasePositionAndOrientation(carrier)[0], linear) + moment * angular
        assert spin == pytest.approx([0.0, 2.0 * raft.off, 0.0], abs=0.02)  # the moment turns with the raft
    arm = np.subtract(client.getBasePositionAndOrientation(ball)[0], client.getBasePositionAndOrientation(carrier)[0])
    parts = np.subtract(velocity, np.add(linear, np.cross(angular, arm)))[2]
    assert parts == pytest.approx(2.0 * restitution, abs=0.06)


LIFT = robot(
    link("base", box((1.0, 1.0, 0.1)), mass=None), link("cage", box((1.0, 1.0, 0.05)), 5.0, (1.0, 1.0, 0.05)),
    joint("rail", "prismatic", "base", "cage", '<limit lower="0" upper="5" effort="1000" velocity="2"/>', axis="0 0 1"),
)  # fmt: skip


def test_a_lift_carries_a_box_up() -> None:
    terrain = Terrain(level(11, 1.0))
    terrain.put("cage", Deck(level(5, 0.25), thickness=0.2))
    with World(terrain) as world:
        world.spawn_robot("lift", LIFT, BodyState((0.0, 0.0, 0.5)))
        lift = world.bodies["lift"].uid
        world.carry("cage", Carrier("lift", "cage", (0.0, 0.0, 0.05)))
        world.spawn("box", Box(0.3, 0.3, 0.3), 2.0, BodyState((0.0, 0.0, 1.3)))
        world.command("lift", "rail", JointCommand(position=0.0, velocity=0.0))
        world.step(240)
        height = world.client.getLinkState(lift, 0)[0][2]
        assert world.state("box").position[2] == pytest.approx(height + 0.2, abs=2e-3)
        world.command("lift", "rail", JointCommand(velocity=0.5))
        for _ in range(240):
            world.step()
        found = world.client.getLinkState(lift, 0, computeLinkVelocity=1)
        assert found[6][2] == pytest.approx(0.5, abs=0.02)
        assert world.state("box").linear[2] == pytest.approx(found[6][2], abs=0.01)
        assert world.state("box").position[2] == pytest.approx(found[0][2] + 0.2, abs=2e-3)
        world.carry("cage", Carrier("lift", "base", (0.0, 0.0, 0.9)))
        world.step()
        above = np.add(world.state("lift").position, [0.0, 0.0, 0.9])
        assert terrain.deck("cage").frame(world.time).position == pytest.approx(above, abs=1e-3)
        with pytest.raises(InputError):
            world.carry("cage", Carrier("lift", "roof"))
        world.carry("cage", Carrier("lift", "cage", (0.0, 0.0, 0.05)))
        world.save()
        world.restore(world.snapshot())  # in another PyBullet
        world.step(60)
        lift = world.bodies["lift"].uid
        height = world.client.getLinkState(lift, 0)[0][2]
        assert world.state("box").position[2] == pytest.approx(height + 0.2, abs=2e-3)
        world.remove("lift")
        world.step(240)
        assert world.state("box").position[2] == pytest.approx(height + 0.2, abs=5e-3)


def test_a_tracked_body_carries_a_deck() -> None:
    """It is told where it is 60 times a second, and the deck turns with it: a box stays at its place of the deck."""
    motion, place = Motion(at=(0.0, 0.0, 2.0)), np.array([1.0, 0.5, 0.25])
    terrain = Terrain(level(11, 2.0))
    terrain.put("deck", Deck(a_map()))
    with World(terrain, config(friction=0.8)) as world:
        world.carry("deck", Carrier("ship", position=(0.0, 0.0, 0.1)))

        def track() -> None:
            now = world.time
            spin, speed = _spin(motion, now), motion.velocity(np.zeros(3), now)
            pose = (tuple(motion.position(now)), tuple(motion.orientation(now)))
            world.track("ship", 0.05, BodyState(*pose, tuple(speed), tuple(spin)))

        track()
        start, speed = motion.to_world(place, 0.0), motion.velocity(place, 0.0)
        state = BodyState(tuple(start), tuple(motion.orientation(0.0)), linear=tuple(speed))
        world.spawn("box", Box(0.5, 0.4, 0.3), 1.0, state)
        places = []
        for step in range(480):
            if step % 4 == 0:
                track()
            world.step()
            places.append(motion.to_deck(np.array(world.state("box").position), world.time))
        found = np.array(places)[120:]
        assert np.abs(found - found[0]).max() < 2e-3


def test_a_deck_is_as_thick_as_it_is() -> None:
    """A bridge above a road: balls on it, below it and inside it, and a box that jumps until its top is above it."""
    terrain = Terrain(level(21, 0.5))
    terrain.put("bridge", Deck(level(9, 0.5), thickness=0.3, position=(0.0, 0.0, 2.0)))
    with World(terrain) as world:
        world.spawn("above", Sphere(0.2), 1.0, BodyState((0.0, 0.0, 2.5)))
        world.spawn("below", Sphere(0.2), 1.0, BodyState((1.0, 0.0, 0.5)))
        world.spawn("beside", Sphere(0.2), 1.0, BodyState((4.0, 0.0, 0.5)))
        speed = math.sqrt(2.0 * G * 1.1)
        world.spawn("jumps", Box(1.0, 1.0, 1.0), 1.0, BodyState((-1.0, 1.0, 0.5), linear=(0.0, 0.0, speed)))
        world.step(100)
        flight = 0.5 + speed * 100 * DT - 0.5 * G * DT**2 * 100 * 101
        assert world.state("jumps").position[2] == pytest.approx(flight, abs=1e-9)
        world.step(380)
        heights = [world.state(name).position[2] for name in ("above", "below", "beside")]
        assert heights == pytest.approx([2.2, 0.2, 0.2], abs=1e-4)
        assert world.rescues == 0
        assert world.patches().table().tiles == ["bridge", "", "", ""]
        world.spawn("inside", Sphere(0.2), 1.0, BodyState((-1.0, 0.0, 1.9)))
        world.step(240)
        assert world.state("inside").position[2] == pytest.approx(2.2, abs=1e-4)
        assert world.rescues == 1


@pytest.mark.parametrize("shape", [Sphere(0.2), Box(0.4, 0.4, 0.4)])
def test_the_walls_of_a_deck_are_as_high_as_it_is_thick(shape: Shape) -> None:
    """Bodies fly towards the rim of a bridge: below its wall they pass, at its wall they stop."""
    terrain = Terrain(level(21, 0.5))
    terrain.put("bridge", Deck(level(9, 0.5), thickness=0.3, position=(0.0, 0.0, 2.0)))
    with World(terrain, WorldConfig(physics=PhysicsConfig(gravity=(0.0, 0.0, 0.0), friction=0.0))) as world:
        for name, y, z in (("below", -1.0, 1.4), ("at the wall", 1.0, 1.9)):
            world.spawn(name, shape, 1.0, BodyState((3.0, y, z), linear=(-2.0, 0.0, 0.0)))
        world.step(240)
        assert world.state("below").position == pytest.approx((1.0, -1.0, 1.4), abs=1e-6)
        assert world.state("at the wall").position[0] == pytest.approx(2.2, abs=1e-3)


def test_queries_rays_and_scans_see_a_deck_where_it_is_at_an_instant(client: Any) -> None:
    motion, rng, time = Motion(), np.random.default_rng(2), 1.3
    deck, terrain = Deck(a_map()), Terrain(level(11, 2.0))
    terrain.put("deck", deck)
    for at in time - DT * np.arange(4.0)[::-1]:
        motion.move(deck, at)
    ground = Ground(client, terrain)
    turn, origin = rotation(motion.orientation(time)), motion.position(time)
    normal = turn[:, 2]
    xy = rng.uniform(-1.5, 1.5, (20, 2))
    found = ground.at(xy, time)
    expected = origin[2] - ((xy - origin[:2]) @ normal[:2]) / normal[2]
    assert found.z == pytest.approx(expected, abs=1e-9)
    assert found.normals == pytest.approx(np.tile(normal, (20, 1)), abs=1e-9)
    points = np.column_stack([xy, found.z])
    speeds = [motion.velocity(motion.to_deck(point, time), time) for point in points]
    assert found.velocities == pytest.approx(np.array(speeds), abs=2e-4)
    assert ground.at(np.column_stack([xy, np.full(20, 1.0)]), time).z == pytest.approx(0.0)
    hits = ground.cast_rays(points + [0.0, 3.0, 4.0], np.tile([0.0, -0.6, -0.8], (20, 1)), 20.0, time)
    assert hits.distances == pytest.approx(5.0, abs=1e-9)
    over = origin[2] + (origin[:2] @ normal[:2]) / normal[2]
    assert terrain.at([[8.0, 8.0], [0.0, 0.0]], time).heights == pytest.approx([0.0, over], abs=1e-9)
    scan = HeightScan(size=(1.0, 1.0), spacing=0.5).read(terrain, np.zeros((1, 4)), time)
    x, y = np.meshgrid([-0.5, 0.0, 0.5], [-0.5, 0.0, 0.5])
    assert scan[0] == pytest.approx((over - (x * normal[0] + y * normal[1]) / normal[2]).ravel(), abs=1e-6)


def test_a_deck_has_the_material_of_its_own_tiles() -> None:
    """A box slides v^2 / (2 mu g) on a deck of ice above a floor that grips, and sinks m g / (k A) into one of foam."""
    terrain = Terrain(level(11, 2.0))
    terrain.put("ice", Deck(level(61, 0.25, material=Material(friction=0.2)), position=(0.0, 0.0, 1.0)))
    foam = Material(stiffness=5e3, damping=5e2)
    turned = (0.0, 0.0, 0.6, 0.8)
    terrain.put("foam", Deck(level(9, 0.25, material=foam), position=(0.0, 12.0, 1.0), orientation=turned))
    with World(terrain, config(friction=0.5)) as world:
        world.spawn("box", Box(0.5, 0.4, 0.3), 1.0, BodyState((0.0, 0.0, 1.15), linear=(2.0, 0.0, 0.0)))
        world.step(720)
        assert world.state("box").position[0] == pytest.approx(4.0 / (2 * 0.1 * G), rel=0.01)
        world.spawn("sunk", Box(0.5, 0.4, 0.3), 1.0, BodyState((0.0, 12.0, 1.15)))
        world.step(480)
        assert 1.15 - world.state("sunk").position[2] == pytest.approx(G / (5e3 * 0.5 * 0.4), rel=0.01)


def test_a_box_sleeps_on_a_deck_at_rest_and_wakes_when_the_deck_moves() -> None:
    deck = Deck(a_map(), position=(0.0, 0.0, 2.0))
    with on_deck(deck) as world:
        world.spawn("box", Box(0.5, 0.4, 0.3), 1.0, BodyState((0.0, 0.0, 2.15)))
        world.spawn("below", Box(0.5, 0.4, 0.3), 1.0, BodyState((8.0, 0.0, 0.15)))
        world.step(480)
        uids = [world.bodies[name].uid for name in ("box", "below")]
        assert [world.ground.is_asleep(uid) for uid in uids] == [True, True]
        for _ in range(60):
            deck.move((0.0, 0.0, 2.0 + 0.5 * world.time - 1.0), time=world.time)
            world.step()
        assert [world.ground.is_asleep(uid) for uid in uids] == [False, True]
        assert world.state("box").linear[2] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("told", [False, True])
def test_a_frame_moves_between_its_poses_to_second_order_and_stops_without_more(told: bool) -> None:
    deck, motion, errors = Deck(a_map()), Motion(), []
    for interval in (0.1, 0.05):
        deck.place(motion.position(0.0), motion.orientation(0.0), time=0.0)
        error = 0.0
        for time in np.arange(1, 30) * interval:
            if told:
                speed = motion.velocity(np.zeros(3), time)
                spin = _spin(motion, time)
                deck.move(motion.position(time), motion.orientation(time), time=time, velocity=speed, spin=spin)
            else:
                motion.move(deck, time)
            if time > 3 * interval:
                frame = deck.frame(time + interval)
                corner = frame.position + frame.rotation @ [2.5, 2.5, 0.0]
                expected = motion.to_world(np.array([2.5, 2.5, 0.0]), time + interval)
                error = max(error, float(np.linalg.norm(corner - expected)))
        errors.append(error)
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.2)
    assert deck.moving(time + 0.2) and not deck.moving(time + 0.23)
    assert (deck.frame(time + 1.0).velocity == 0.0).all()


def _spin(motion: Motion, time: float) -> FloatArray:
    """Angular velocity of a frame by central differences [rad/s]."""
    after, before = (rotation(motion.orientation(time + by)) for by in (1e-4, -1e-4))
    skew = (after - before) / 2e-4 @ rotation(motion.orientation(time)).T
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def test_a_copy_of_a_terrain_has_decks_of_its_own() -> None:
    deck, terrain = Deck(a_map()), Terrain()
    terrain.put("deck", deck)
    for time in (0.0, 0.1, 0.2):
        Motion().move(deck, time)
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


def test_what_is_no_deck_is_refused() -> None:
    deck, terrain = Deck(a_map()), Terrain(a_map())
    deck.move((0.0, 0.0, 0.0), time=1.0)
    for wrong in (
        lambda: deck.move((0.0, 0.0), time=2.0),
        lambda: deck.move((0.0, 0.0, math.nan), time=2.0),
        lambda: deck.move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0), time=2.0),
        lambda: deck.move((0.0, 0.0, 0.0), time=0.5),
        lambda: deck.move((0.0, 0.0, 0.0), time=2.0, velocity=(1.0, 0.0, 0.0)),
        lambda: Deck(a_map(), thickness=-1.0),
        lambda: terrain.put("", deck),
        lambda: terrain.deck("deck"),
    ):
        with pytest.raises(InputError):
            wrong()
    terrain.put("deck", deck)
    with pytest.raises(InputError):
        terrain.put("deck", a_map())
    with World(terrain) as world, pytest.raises(InputError):
        world.ground.carry("deck", 99)
    terrain.remove("deck")
    assert not terrain.decks
