"""Decks that bodies carry, which take the reaction, and a rover that drives from a deck onto ground at rest."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, HeightMap, InputError, Sphere, World
from smartmesh_ros.world.driving import Carrier
from smartmesh_ros.world.joints import JointCommand
from tests.bodies import about_y, ground_of, put, rotation
from tests.grounds import level, terrain_of, world_of
from tests.urdfs import HUSKY, box, joint, link, robot

DT = 1.0 / 240.0
RAFT = Box(2.0, 2.0, 0.2)


def test_cargo_rides_on_a_robot_that_drives_and_turns_and_sleeps_on_the_ground_once_the_deck_is_taken_away() -> None:
    terrain = terrain_of(ground=level(81, 0.5), bed=Deck(level(9, 0.1), thickness=0.2))
    with world_of(terrain, friction=0.9) as world:
        world.spawn_robot("husky", HUSKY, BodyState((0.0, 0.0, 0.15)))
        world.carry("bed", Carrier("husky", position=(0.0, 0.0, 0.45)))
        world.spawn("cargo", Box(0.3, 0.3, 0.2), 20.0, BodyState((0.0, 0.0, 0.72)))
        world.step(240)
        wheels = [it.name for it in world.joints("husky") if "wheel" in it.name]
        places = []
        for step in range(480):
            for name in wheels:
                speed = 4.0 if "left" in name else 8.0
                world.command("husky", name, JointCommand(velocity=speed * min(step / 60.0, 1.0)))
            world.step()
            frame = terrain.deck("bed").frame(world.time)
            places.append(frame.rotation.T @ (np.array(world.state("cargo").position) - frame.position))
        found = np.array(places)
        assert np.abs(found[:, 2] - 0.1).max() < 1e-4
        assert np.linalg.norm(found[:, :2] - found[0, :2], axis=1).max() < 1e-3
        assert math.hypot(*world.state("husky").position[:2]) > 1.0
        terrain.remove("bed")
        world.remove("husky")
        world.step(720)
        assert world.is_asleep("cargo")


def test_a_rover_drives_from_a_rolling_deck_over_a_ramp_onto_ground_at_rest() -> None:
    """A ramp of the deck leads down to its end, which lies on the quay, on the axis about which the deck pitches."""
    x = np.arange(0.0, 6.01, 0.1)
    ramp = np.tile(np.interp(x, [0.0, 5.0, 6.0], [0.3, 0.3, 0.0]), (31, 1))
    deck = Deck(HeightMap(ramp, resolution=0.1, origin=(0.0, -1.5)))
    terrain = terrain_of(quay=HeightMap(np.zeros((31, 61)), resolution=0.1, origin=(5.9, -1.5)), deck=deck)
    axis = np.array([6.0, 0.0, 0.0])
    with world_of(terrain, friction=1.0) as world:
        climbs = []
        for step in range(1500):
            turn = about_y(math.radians(3.0) * math.sin(math.tau * world.time / 8.0))
            deck.move(axis - rotation(turn) @ axis, turn, time=world.time)
            if step == 0:
                world.spawn_robot("husky", HUSKY, BodyState((3.0, 0.0, 0.6)))
            if step == 240:
                over = rotation(turn).T @ (np.array(world.state("husky").position) - axis)
                for wheel in (it.name for it in world.joints("husky") if "wheel" in it.name):
                    world.command("husky", wheel, JointCommand(velocity=6.0))
            world.step()
            climbs.append(world.state("husky").linear[2])
        x, _, z = world.state("husky").position
        assert x > 8.0
        assert z == pytest.approx(over[2] - 0.3, abs=0.01)
        assert np.abs(np.diff(climbs[240:])).max() < 0.1  # m/s in a step: no jump


# What carries a deck in free flight: its kind, its mass [kg], and where on it a ball lands [m].
@pytest.mark.parametrize(
    ("maximal", "mass", "off"), [(True, 2.0, 0.8), (False, 2.0, 0.8), (True, 10.0, 0.0), (False, 0.5, 0.0)]
)
@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_a_ball_and_the_free_body_whose_deck_it_lands_on_conserve_momentum(
    client: Any, maximal: bool, mass: float, off: float, restitution: float
) -> None:
    """At the end of each step; and they part with the restitution of their speed."""
    client.setGravity(0.0, 0.0, 0.0)
    carrier = put(client, RAFT, (0.0, 0.0, 1.0), mass, useMaximalCoordinates=maximal)
    ball = put(client, Sphere(0.1), (off, 0.0, 1.8), useMaximalCoordinates=1)
    client.resetBaseVelocity(ball, (0.0, 0.0, -2.0))
    for body in (carrier, ball):
        client.changeDynamics(body, -1, restitution=restitution, lateralFriction=0.0)
        client.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
    ground = ground_of(client, terrain_of(deck=Deck(level(9, 0.25))), ball)
    ground.carry("deck", carrier, position=(0.0, 0.0, 0.3))
    for step in range(120):
        ground.step(step * DT, DT)
        velocity, (linear, angular) = client.getBaseVelocity(ball)[0], client.getBaseVelocity(carrier)
        assert np.array(velocity) + mass * np.array(linear) == pytest.approx([0.0, 0.0, -2.0], abs=1e-9)
        moment = np.array(client.getDynamicsInfo(carrier, -1)[2])
        spin = np.cross(client.getBasePositionAndOrientation(ball)[0], velocity)
        spin = spin + mass * np.cross(client.getBasePositionAndOrientation(carrier)[0], linear) + moment * angular
        assert spin == pytest.approx([0.0, 2.0 * off, 0.0], abs=0.02)  # the moment turns with the raft
    arm = np.subtract(client.getBasePositionAndOrientation(ball)[0], client.getBasePositionAndOrientation(carrier)[0])
    parts = np.subtract(velocity, np.add(linear, np.cross(angular, arm)))[2]
    assert parts == pytest.approx(2.0 * restitution, abs=0.06)


LIFT = robot(
    link("base", box((1.0, 1.0, 0.1)), mass=None), link("cage", box((1.0, 1.0, 0.05)), 5.0, (1.0, 1.0, 0.05)),
    joint("rail", "prismatic", "base", "cage", '<limit lower="0" upper="5" effort="1000" velocity="2"/>', axis="0 0 1"),
)  # fmt: skip


# Carriers that cannot be, also while there is no such body.
WRONG: list[Any] = [
    *(Carrier("lift", "roof"), "lift", Carrier("lift", position=(0.0, 0.0)), Carrier("lift", orientation=(0.0,) * 4)),
    *(Carrier("later", "roof", (0.0, 0.0)), Carrier("later", position="up")),  # type: ignore[arg-type]
]


def test_a_lift_carries_a_box_up_also_once_it_is_restored_and_rests_when_the_lift_is_gone() -> None:
    with World(terrain_of(ground=level(11, 1.0), cage=Deck(level(5, 0.25), thickness=0.2))) as world:
        world.spawn_robot("lift", LIFT, BodyState((0.0, 0.0, 0.5)))
        world.carry("cage", Carrier("lift", "cage", (0.0, 0.0, 0.05)))
        world.spawn("box", Box(0.3, 0.3, 0.3), 2.0, BodyState((0.0, 0.0, 1.1)))
        world.command("lift", "rail", JointCommand(velocity=0.5))
        for _ in range(2):
            world.step(240)
            cage = world.client.getLinkState(world.bodies["lift"].uid, 0, 1, 1)  # velocity, and where the link is now
            assert cage[6][2] == pytest.approx(0.5, abs=1e-3)
            assert world.state("box").linear[2] == pytest.approx(cage[6][2], abs=1e-3)
            assert world.state("box").position[2] == pytest.approx(cage[0][2] + 0.2, abs=1e-4)
            world.restore(world.save())  # in another PyBullet
            world.step()
        cage = world.client.getLinkState(world.bodies["lift"].uid, 0, 1, 1)
        for wrong in WRONG:
            with pytest.raises(InputError):
                world.carry("cage", wrong)
        world.step()
        assert world.carried == {"cage": Carrier("lift", "cage", (0.0, 0.0, 0.05))}
        world.remove("lift")
        world.step(240)
        assert world.state("box").position[2] == pytest.approx(cage[0][2] + 0.2, abs=5e-3)
        assert world.state("box").linear[2] == pytest.approx(0.0, abs=1e-3)


def test_a_body_without_the_link_carries_nothing_and_a_later_one_of_its_name_that_has_it_does() -> None:
    said: list[str] = []
    with World(terrain_of(ground=level(11, 1.0), cage=Deck(level(5, 0.25), thickness=0.2))) as world:
        world.say = said.append
        world.carry("cage", Carrier("lift", "cage"))
        for _ in range(2):
            world.spawn("lift", Box(0.3, 0.3, 0.3), 2.0, BodyState((0.0, 0.0, 0.5)))
            world.step(3)
            assert world.terrain.deck("cage").body < 0
            world.remove("lift")
        assert len(said) == 2 and all("nothing carries deck 'cage'" in words for words in said)
        world.spawn_robot("lift", LIFT, BodyState((0.0, 0.0, 0.5)))
        world.step()
        assert world.terrain.deck("cage").body == world.bodies["lift"].uid


SLEDGE = Box(0.7, 0.7, 0.2)


def on_sledge(ground: HeightMap, load: Any, masses: tuple[float, float], start: BodyState) -> World:
    """A world whose sledge carries a deck, on the ground at the origin, and a load that starts somewhere."""
    world = World(terrain_of(ground=ground, deck=Deck(level(9, 0.1), thickness=0.1)))
    up = rotation(start.orientation)[:, 2]
    world.spawn("sledge", SLEDGE, masses[0], BodyState(tuple(0.1 * up), start.orientation))
    world.carry("deck", Carrier("sledge", position=(0.0, 0.0, 0.11)))
    world.spawn("load", load, masses[1], start)
    for body in ("sledge", "load"):
        world.client.changeDynamics(world.bodies[body].uid, -1, linearDamping=0.0, angularDamping=0.0)
    return world


# Masses of a sledge and its load [kg], and how far the load is from the middle [m].
LOADS = [(20.0, 5.0, 0.2), (20.0, 20.0, 0.15), (20.0, 40.0, 0.0), (5.0, 20.0, 0.05)]


@pytest.mark.parametrize("grade", [0.0, 0.17])
@pytest.mark.parametrize(("sledge", "load", "off"), LOADS)
def test_a_load_of_any_mass_rests_on_its_carrier_also_on_a_slope_and_off_the_middle(
    sledge: float, load: float, off: float, grade: float
) -> None:
    x = np.arange(41) * 0.25 - 5.0
    slope = HeightMap(np.tile(x * grade, (41, 1)), resolution=0.25, origin=(-5.0, -5.0))
    angle = math.atan(grade)
    lies = about_y(-angle)
    start = BodyState(tuple(rotation(lies) @ (off, 0.0, 0.31)), tuple(lies))
    with on_sledge(slope, Box(0.4, 0.4, 0.2), (sledge, load), start) as world:
        world.step(240)
        before = [np.array(world.state(body).position) for body in ("sledge", "load")]
        world.step(240)
        after = [np.array(world.state(body).position) for body in ("sledge", "load")]
        assert np.linalg.norm(np.subtract(after, before), axis=1).max() < 2e-4
        rides = rotation(lies).T @ (after[1] - after[0])
        assert rides == pytest.approx([off, 0.0, 0.21], abs=2e-4)


@pytest.mark.parametrize("pushed", ["sledge", "load"])
@pytest.mark.parametrize("off", [0.1, 0.36])  # 0.36: most of the load is beside the sledge itself
def test_a_carrier_and_its_load_sleep_once_they_rest_and_wake_together(off: float, pushed: str) -> None:
    with on_sledge(level(81, 0.5), Box(0.2, 0.2, 0.2), (20.0, 3.0), BodyState((off, 0.0, 0.31))) as world:
        for is_pushed in (False, True):
            if is_pushed:
                world.client.resetBaseVelocity(world.bodies[pushed].uid, (0.0, 0.5, 0.0))
                world.step(3)
                assert not world.is_asleep("sledge") and not world.is_asleep("load")
            world.step(480)
            assert world.state("load").position[2] == pytest.approx(0.31, abs=1e-4)
            assert world.is_asleep("sledge") and world.is_asleep("load")


@pytest.mark.parametrize(("sledge", "load"), [(20.0, 5.0), (20.0, 20.0), (5.0, 20.0)])
def test_a_load_is_taken_along_by_a_carrier_that_is_pushed_without_slip(sledge: float, load: float) -> None:
    with on_sledge(level(81, 0.5), Box(0.4, 0.4, 0.2), (sledge, load), BodyState((0.0, 0.0, 0.31))) as world:
        world.client.changeDynamics(world.bodies["sledge"].uid, -1, lateralFriction=0.0)
        world.step(60)
        for _ in range(240):
            force = (1.5 * (sledge + load), 0.0, 0.0)
            world.client.applyExternalForce(world.bodies["sledge"].uid, -1, force, world.state("sledge").position, 2)
            world.step()
        for body in ("sledge", "load"):
            assert world.state(body).linear[0] == pytest.approx(1.5, abs=1e-3)
        assert world.state("load").position[0] - world.state("sledge").position[0] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("mass", [2.0, 1.0, 0.5])
def test_a_ball_that_slides_onto_a_carrier_which_slides_without_friction_rolls_on_it_as_momentum_says(
    mass: float,
) -> None:
    """The impulse that ends the slip is v / (1 / m + 5 / (2 m) + 1 / M), by the inertia of the ball."""
    start = BodyState((-0.2, 0.0, 0.31), linear=(0.3, 0.0, 0.0))
    with on_sledge(level(81, 0.5), Sphere(0.1), (mass, 1.0), start) as world:
        world.client.changeDynamics(world.bodies["sledge"].uid, -1, lateralFriction=0.0)
        world.step(120)
        impulse = 0.3 / (1.0 + 2.5 + 1.0 / mass)
        assert world.state("sledge").linear[0] == pytest.approx(impulse / mass, abs=3e-4)
        assert world.state("load").linear[0] == pytest.approx(0.3 - impulse, abs=3e-4)


CARRIERS: dict[str, Callable[[World], object]] = {
    "spawned": lambda world: world.spawn("raft", RAFT, 5.0),
    "robot": lambda world: world.spawn_robot("raft", robot(link("base", box((2.0, 2.0, 0.2)), 5.0))),
    "tracked": lambda world: world.track("raft", RAFT, BodyState()),
    "guest": lambda world: world.add_guest("raft", "peer", RAFT, 5.0),
}
ENDS: dict[str, Callable[[World], object]] = {
    "it is removed": lambda world: world.remove_guest("raft"),  # as by `remove`, also where no guest is restored
    "it lets go": lambda world: world.carry("deck", None),
}


def falling_raft(carrier: str) -> World:
    """A world whose raft falls, turns and carries a deck, and whose ball falls as fast above it."""
    world = World(terrain_of(ground=level(11, 1.0), deck=Deck(level(21, 0.1), thickness=0.2)))
    CARRIERS[carrier](world)
    raft = world.bodies["raft"].uid
    world.client.resetBasePositionAndOrientation(raft, (0.0, 0.0, 9.0), (0.0, 0.0, 0.0, 1.0))
    world.client.resetBaseVelocity(raft, (0.3, 0.0, 1.0), (0.1, 0.2, 0.3))
    world.carry("deck", Carrier("raft", position=(0.2, 0.0, 0.3)))
    world.spawn("ball", Sphere(0.1), 1.0, BodyState((0.0, 0.0, 9.9), linear=(0.3, 0.0, 1.0)))
    world.step(24)
    return world


def rest(world: World) -> list[list[float]]:
    """Return where the deck and the ball are after each step of half a second, at the end of which the deck rests."""
    found = []
    for _ in range(120):
        world.step()
        frame = world.terrain.deck("deck").frame(world.time)
        found.append([*np.concatenate([part.ravel() for part in frame]), *world.state("ball").position])
    assert not frame.velocity.any()
    assert not frame.spin.any()
    return found


@pytest.mark.parametrize(
    "change", [lambda world: world.ground.show(), lambda world: world.spawn("far", RAFT, 1.0)], ids=["shown", "spawned"]
)
def test_what_else_comes_leaves_the_acceleration_of_a_carrier(change: Callable[[World], object]) -> None:
    with falling_raft("spawned") as world, falling_raft("spawned") as other:
        change(other)
        for each in (world, other):
            each.step()
        frames = [each.terrain.deck("deck").frame(each.time + 0.5 * DT) for each in (world, other)]
        assert all(map(np.array_equal, *frames))


@pytest.mark.parametrize("saved", ["before", "after"])
@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("carrier", CARRIERS)
def test_a_deck_rests_when_its_carrier_goes_between_the_steps_around_a_saved_state(
    carrier: str, end: str, saved: str
) -> None:
    """To the bit as in the run that was not saved."""
    with falling_raft(carrier) as world, World() as other:
        if saved == "after":
            ENDS[end](world)
        other.restore(world.state_bytes())
        if saved == "before":
            ENDS[end](world)
            ENDS[end](other)
        assert rest(other) == rest(world)
