"""The k-th call to PyBullet fails, for k = 1, 2, ...: what failed has changed nothing, and the world goes on."""

from collections.abc import Callable
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pytest
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, Ground, JointCommand, MotionConfig, PhysicsConfig, Soil, World, WorldConfig
from smartmesh_ros.ground.shapes import Box, Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import Changes
from smartmesh_ros.world.states import SimulatedStates
from tests.faults import Faults, bullet_faults
from tests.grounds import level
from tests.urdfs import joint, link, robot

CUBE = '<box size="0.2 0.2 0.2"/>'
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="1"/>'
BASE = link("base", CUBE, moment=0.1)
ROBOT = robot(BASE, link("arm", CUBE, moment=0.1), joint("hinge", "revolute", "base", "arm", LIMIT, "0.3 0 0"))
OTHER = robot(BASE)
# `BulletClient` cannot be deleted if it is not connected.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
ABOVE = BodyState((0.0, 1.5, 0.15))


@pytest.fixture
def faults(monkeypatch: pytest.MonkeyPatch) -> Faults:
    return bullet_faults(monkeypatch)


def made(*, robots: bool = True, after: float = 0.5, changes: Changes = "motion") -> World:
    """A world with a box, a tracked ball and, if asked for, a robot; it has run for some steps."""
    config = WorldConfig(physics=PhysicsConfig(sleep=True))
    config = replace(config, sleep=replace(config.sleep, after=after))
    world = World(level(61, motion=MotionConfig(changes=changes)), config)
    world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((0.0, 0.0, 0.1)))
    world.track("ball", 0.2, BodyState((1.0, 0.0, 0.3)))
    if robots:
        world.spawn_robot("robot", ROBOT, BodyState((-1.0, 0.0, 0.1)))
        world.command("robot", "hinge", JointCommand(position=0.1))
    world.step(10)
    return world


WEAK = WorldConfig(physics=PhysicsConfig(gravity=(0.0, 0.0, -5.0)))
# What is done to a world, and the names that come and go by it.
OPERATIONS: dict[str, tuple[Callable[[World], object], set[str], set[str]]] = {
    "spawn": (lambda w: w.spawn("new", Sphere(0.15), 1.0, ABOVE), {"new"}, set()),
    "spawn on ground": (lambda w: w.spawn("new", Box(0.2, 0.3, 0.2), 1.0, ABOVE, on_ground=True), {"new"}, set()),
    "spawn robot": (lambda w: w.spawn_robot("new", ROBOT, ABOVE), {"new"}, set()),
    "track": (lambda w: w.track("new", 0.1, BodyState((1.0, 2.0, 0.3))), {"new"}, set()),
    "track larger": (lambda w: w.track("ball", 0.3, BodyState((1.0, 0.0, 0.4))), set(), set()),
    "remove": (lambda w: w.remove("box"), set(), {"box"}),
    "remove robot": (lambda w: w.remove("robot"), set(), {"robot"}),
    "replace robot": (lambda w: w.replace_robot("robot", OTHER), set(), set()),
    "command": (lambda w: w.drive("robot", "hinge", 0.5), set(), set()),
    "move": (lambda w: w.move("robot", BodyState((-1.0, 1.0, 0.1), linear=(0.0, 0.1, 0.0))), set(), set()),
    "restore": (lambda w: w.save(), set(), set()),
    "configure": (lambda w: w.configure(WEAK), set(), set()),
    "drive surface": (lambda w: w.drive_surface("box", "", 0.3), set(), set()),
    "soil": (lambda w: w.ground.set_soil(Soil(w.terrain, "clay")), set(), set()),
}


def alone(world: World) -> int:
    """How many bodies the client has beside those of the world and one proxy for each solid follower; the followers are
    those of the world's bodies."""
    wanted = 0
    for name, body in world.bodies.items():
        links = [f"{name}/{link}" for link in body.links.values()] if body.is_robot else [name]
        assert sorted(world.followers[slot].name for slot in world.followers.of(body.uid)) == sorted(links)
        wanted += len(links)
    assert wanted == len(world.followers) == len(list(world.followers))
    return int(world.client.getNumBodies()) - len(world.bodies) - sum(follower.solid for follower in world.followers)


def assert_whole(world: World) -> None:
    assert alone(world) == 0


def set_ground(world: World, height: float) -> None:
    tile = world.terrain.tile("")
    still = None if tile.motion.corrects else np.zeros((61, 61), np.float32)
    tile.replace(np.full((61, 61), height), time=world.time, velocities=still)


def assert_goes_on(world: World, height: float = 0.0) -> None:
    """Bodies fall and stand on ground of this height, none is lost, and the client is whole."""
    world.spawn("probe", Sphere(0.1), 1.0, BodyState((2.0, -2.0, height + 0.11)))
    world.step(24)
    assert not world.lost
    assert world.below_ground() == []
    assert world.state("probe").position[2] == pytest.approx(height + 0.1, abs=5e-3)
    for name, body in world.bodies.items():
        if body.simulated:
            assert world.state(name).position[2] > 0.05, name
    world.remove("probe")
    assert_whole(world)


def known(world: World) -> tuple[dict[str, FloatArray], list[Any]]:
    """Numbers of the states of the bodies, and their commands, belts, soil and settings."""
    numbers = {name: np.concatenate(astuple(world.state(name))) for name in world.bodies}
    commands = {name: dict(body.commands) for name, body in world.bodies.items()}
    gravity = {name: value for name, value in world.client.getPhysicsEngineParameters().items() if "gravity" in name}
    return numbers, [commands, [it.belt for it in world.followers], world.ground.soil, world.config, gravity]


@pytest.mark.parametrize("name", OPERATIONS)
def test_an_operation_is_done_or_has_changed_nothing(faults: Faults, name: str) -> None:
    operation, come, go = OPERATIONS[name]
    for number in faults.runs():
        with made() as world:
            numbers, settings = known(world)
            if not faults.done(number, lambda: operation(world)):
                found, still = known(world)
                assert (found.keys(), still) == (numbers.keys(), settings), faults.fired
                np.testing.assert_allclose(list(found.values()), list(numbers.values()), rtol=0.0, atol=1e-9)
                assert_whole(world)
                world.step(3)
                assert_whole(world)
                operation(world)
            assert set(world.bodies) == (set(numbers) | come) - go
            assert_goes_on(world)


def test_a_step_that_failed_is_made_again(faults: Faults) -> None:
    """The map has changed under the bodies before the step."""
    for number in faults.runs():
        with made() as world:
            set_ground(world, 0.02)
            time = world.time
            if not faults.done(number, world.step):
                assert world.time in (time, time + world.dt)
            assert_goes_on(world, 0.02)


@pytest.mark.parametrize("way", ["sleep", "wake", "ground"])
@pytest.mark.parametrize("changes", ["motion", "correction"])
def test_bodies_sleep_and_wake_whatever_failed(faults: Faults, way: str, changes: Changes) -> None:
    """All fall asleep, wake and stand on ground that sank, although a call failed in a step before or in `wake`."""
    for number in faults.runs():
        with made(after=0.02, changes=changes) as world:
            if way != "sleep":
                fall_asleep(world)
            if way == "ground":
                set_ground(world, -0.2)
            faults.done(number, world.wake if way == "wake" else lambda: world.step(8))
            if way != "ground":
                world.step(3)
                fall_asleep(world)
                set_ground(world, -0.2)
            world.step(120)
            assert world.state("box").position[2] == pytest.approx(-0.1, abs=2e-3), faults.fired
            fall_asleep(world)
            assert not world.lost
            assert_whole(world)


def fall_asleep(world: World) -> None:
    for _ in range(480):
        world.step()
        if world.is_asleep("box") and world.is_asleep("robot"):
            return
    raise AssertionError("bodies at rest stay awake")


def test_guests_come_and_go_whatever_failed(faults: Faults) -> None:
    """A remote body comes near, and goes; then its owner is forgotten."""
    with made(robots=False) as other:
        other.remove("box")
        other.spawn("guest", Sphere(0.1), 1.0, BodyState((0.3, 0.0, 0.1)))
        near = SimulatedStates(other).read()
        other.move("guest", BodyState((50.0, 0.0, 0.1)))
        far = SimulatedStates(other).read()
    for way in ("comes", "goes", "is forgotten"):
        for number in faults.runs():
            with made(robots=False) as world:
                world.guests.take("other", near, world.time)
                if way != "comes":
                    world.step(10)
                    assert "guest" in world.bodies
                if way == "goes":
                    world.guests.take("other", far, world.time)
                faults.done(number, (lambda: world.guests.forget("other")) if way == "is forgotten" else world.step)
                world.step(10)
                assert ("guest" in world.bodies) == (way == "comes" or (way != "goes" and bool(world.guests.counts)))
                assert_whole(world)
                world.guests.forget("other")
                assert set(world.bodies) == {"box", "ball"}
                assert_goes_on(world)


@pytest.mark.parametrize("way", ["make", "attach", "detach", "close", "step"])
def test_a_clients_ground_is_made_and_its_bodies_are_attached_or_not(faults: Faults, way: str, tmp_path: Path) -> None:
    """For the world of a PyBullet user: what fails leaves the client as it was, and may be asked for again."""
    (tmp_path / "robot.urdf").write_text(ROBOT)
    for number in faults.runs():
        client: Any = BulletClient(pb.DIRECT)
        client.setGravity(0.0, 0.0, -9.81)
        robot = client.loadURDF(str(tmp_path / "robot.urdf"), (0.0, 0.0, 0.1))
        grounds = [] if way == "make" else [Ground(client, level(61))]
        if way not in ("make", "attach"):
            grounds[0].attach(robot)
        actions: dict[str, Callable[[], object]] = {
            "make": lambda: grounds.append(Ground(client, level(61))),  # noqa: B023
            "attach": lambda: grounds[0].attach(robot),  # noqa: B023
            "detach": lambda: grounds[0].detach(robot),  # noqa: B023
            "close": lambda: grounds[0].close(),  # noqa: B023, PLW0108
            "step": lambda: grounds[0].step(0.0, 1.0 / 240.0),  # noqa: B023
        }
        proxies = 0 if way in ("make", "attach") else 2
        if not faults.done(number, actions[way]):
            assert client.getNumBodies() == 1 + proxies
            assert sum(len(ground.followers) for ground in grounds) == proxies
            client.stepSimulation()
            actions[way]()
        if way == "make":
            grounds[0].attach(robot)
        assert client.getNumBodies() == (1 if way in ("detach", "close") else 3)
        client.disconnect()
