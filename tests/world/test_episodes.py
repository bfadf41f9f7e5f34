"""An episode begins as the first one did: `World.reset` with a seed."""

import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest

from smartmesh_ros import HeightScan, InputError, World
from tests.grounds import level
from tests.memory import allocated
from tests.world.random_worlds import RandomWorld

SCAN = HeightScan(size=(0.4, 0.4), spacing=0.2, noise=0.02)
# Of `random_worlds`: robots on soil that waves, soil in regions, and decks, one of which a body carries.
SEEDS = (11, 67, 3)


def episode(it: RandomWorld, seed: int, steps: int = 95) -> tuple[str, list[list[float]]]:
    it.world.reset(seed)
    it.track_hand()
    return it.run(0, steps), it.world.height_scan("body_0", SCAN).tolist()


@pytest.fixture(params=SEEDS)
def it(request: pytest.FixtureRequest) -> Iterator[RandomWorld]:
    made = RandomWorld(request.param)
    yield made
    made.world.close()


def test_episodes_are_equal_to_the_bit_whatever_was_before(it: RandomWorld) -> None:
    first = episode(it, 1)
    for more in (3, 61):
        it.world.step(more)
        it.world.wake()
        assert episode(it, 1) == first
    other = RandomWorld(it.seed)
    assert episode(other, 1) == first, "in another world"
    other.world.close()


def test_the_seed_is_that_of_chance(it: RandomWorld) -> None:
    (bodies, scan), (same, other) = episode(it, 1, 10), episode(it, 2, 10)
    assert (bodies == same, scan == other) == (True, False)
    for seed in (-1, 1.5, "a"):
        before = it.world.snapshot()
        with pytest.raises(InputError, match="seed"):
            it.world.reset(seed)  # type: ignore[arg-type]
        assert it.world.snapshot() == before


@pytest.mark.parametrize("it", [11], indirect=True)
def test_without_a_seed_the_terrain_and_commands_stay(it: RandomWorld) -> None:
    world, start = it.world, it.world.state("body_0")
    episode(it, 1)
    ground, commands = world.terrain.tile("").heights.copy(), dict(world.bodies["robot_0"].commands)
    world.reset()
    assert (world.time, world.state("body_0")) == (0.0, start)
    np.testing.assert_array_equal(world.terrain.tile("").heights, ground)
    assert world.bodies["robot_0"].commands == commands != {}
    world.reset(1)
    assert not np.array_equal(world.terrain.tile("").heights, ground)
    assert world.bodies["robot_0"].commands == {}


@pytest.mark.parametrize("it", [11], indirect=True)
def test_many_episodes_take_no_more_memory_than_few(it: RandomWorld) -> None:
    for _ in range(10):
        episode(it, 1, 10)
    before = allocated()
    for _ in range(20):
        episode(it, 1, 10)
    assert allocated() - before < 20 * 4 * 1024


def test_the_terrain_of_the_first_step_is_kept_as_one_copy() -> None:
    side = 1000
    with World(level(side)) as world:
        tracemalloc.start()
        try:
            world.step()
            _, most = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert most < 1.5 * side * side * np.float32().nbytes
