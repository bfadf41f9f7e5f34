"""An episode begins as the first one did: `World.reset` with a seed."""

import math
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest

from smartmesh_ros import BodyState, Box, Deck, HeightMap, HeightScan, InputError, Soil, Sphere, World
from smartmesh_ros.world.driving import Carrier
from smartmesh_ros.world.joints import JointCommand
from tests.memory import allocated
from tests.urdfs import HUSKY, ROVER

SIDE = 41
SCAN = HeightScan(size=(0.4, 0.4), spacing=0.2, noise=0.02)


def heights(time: float) -> np.ndarray:
    y, x = 0.1 * np.mgrid[:SIDE, :SIDE] - 2.0
    return np.asarray(0.1 * (x * x + y * y) + 0.04 * np.sin(3.0 * x - 4.0 * time))


def environment(kind: str = "moving") -> World:
    """Two robots, boxes and balls in a bowl; of soil, or with decks above it, one of which a robot carries."""
    world = World(HeightMap(heights(0.0), resolution=0.1, origin=(-2.0, -2.0)))
    if kind == "soil":
        world.ground.set_soil(Soil(world.terrain, "dry_sand", spacing=0.02))
    for name, urdf, x in (("husky", HUSKY, -0.6), ("rover", ROVER, 0.6)):
        world.spawn_robot(name, urdf, BodyState((x, 0.0, 0.6)))
    for index in range(6):
        shape = Box(0.2, 0.15, 0.2) if index % 2 else Sphere(0.1)
        world.spawn(f"body_{index}", shape, 2.0, BodyState((0.4 * index - 1.0, 0.7, 0.5)))
    if kind == "decks":
        for deck in ("ship", "bed"):
            tile = HeightMap(np.zeros((9, 9)), resolution=0.1, origin=(-0.4, -0.4))
            world.terrain.put(deck, Deck(tile, thickness=0.1, position=(-1.0, -1.0, 1.0)))
        world.carry("bed", Carrier("husky", position=(0.0, 0.0, 0.3)))
        world.spawn("load", Box(0.3, 0.3, 0.1), 3.0, BodyState((-0.6, 0.0, 1.0)))
        world.spawn("passenger", Sphere(0.1), 3.0, BodyState((-1.0, -1.0, 1.101)))
    return world


def act(world: World, step: int) -> None:
    """What the policy does."""
    if step % 20 == 5:
        for name in ("husky", "rover"):
            for joint in world.bodies[name].joints:
                world.command(name, joint, JointCommand(velocity=2.0))
    if step % 8 == 0 and world.ground.soil is None:
        world.terrain.tiles[""].replace(heights(world.time), time=world.time)  # type: ignore[union-attr]
        if "ship" in world.terrain.decks:
            roll = 0.05 * math.sin(3.0 * world.time)
            turn = (math.sin(roll), 0.0, 0.0, math.cos(roll))
            world.terrain.deck("ship").move((-1.0, -1.0, 1.0 + roll), turn, time=world.time)


def episode(world: World, seed: int, steps: int) -> list[object]:
    """Return what an episode is like."""
    world.reset(seed)
    for step in range(steps):
        act(world, step)
        world.step()
    return [world.snapshot(), world.contacts(), world.height_scan("husky", SCAN).tolist(), world.is_asleep("body_0")]


@pytest.fixture(params=["moving", "soil", "decks"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def world(kind: str) -> Iterator[World]:
    with environment(kind) as made:
        yield made


def test_episodes_are_equal_to_the_bit_whatever_was_before(world: World, kind: str) -> None:
    first = episode(world, 1, 200)
    for more in (3, 61):
        world.step(more)
        world.wake()
        assert episode(world, 1, 200) == first
    with environment(kind) as other:
        assert episode(other, 1, 200) == first, "in another world"


def test_the_seed_is_that_of_chance(world: World) -> None:
    *_, scan, _ = episode(world, 1, 10)
    *bodies, other, _ = episode(world, 2, 10)
    assert bodies == episode(world, 1, 10)[:2]
    assert scan != other
    for seed in (-1, 1.5, "a"):
        before = world.snapshot()
        with pytest.raises(InputError, match="seed"):
            world.reset(seed)  # type: ignore[arg-type]
        assert world.snapshot() == before


def test_without_a_seed_the_terrain_and_commands_stay(world: World) -> None:
    episode(world, 1, 100)
    ground, command = world.terrain.tiles[""].heights.copy(), dict(world.bodies["husky"].commands)  # type: ignore[union-attr]
    world.reset()
    np.testing.assert_array_equal(world.terrain.tiles[""].heights, ground)  # type: ignore[union-attr]
    assert world.bodies["husky"].commands == command != {}
    world.reset(1)
    assert not np.array_equal(world.terrain.tiles[""].heights, ground)  # type: ignore[union-attr]
    assert world.bodies["husky"].commands == {}


def test_many_episodes_take_no_more_memory_than_few() -> None:
    with environment() as world:
        for _ in range(10):
            episode(world, 1, 10)
        before = allocated()
        for _ in range(20):
            episode(world, 1, 10)
        assert allocated() - before < 20 * 4 * 1024


def test_the_terrain_of_the_first_step_is_kept_as_one_copy() -> None:
    side = 1000
    with World(HeightMap(np.zeros((side, side)), resolution=0.1)) as world:
        tracemalloc.start()
        try:
            world.step()
            _, most = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert most < 1.5 * side * side * np.float32().nbytes
