"""Bodies that sleep end where they would have ended awake, whatever is done to their world."""

import math
from typing import Any

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from smartmesh_ros import BodyState, HeightMap, PhysicsConfig, Terrain, World, WorldConfig
from tests.examples import examples
from tests.ground.test_sleep import BOX, FLAT, RATE, SIDE, SPACING


class SleepingBesideAwake(RuleBasedStateMachine):
    """One world sleeps, one never does; both are told the same. No body of the first may be elsewhere than in the
    second, and its supports are those that fresh tables give."""

    def __init__(self) -> None:
        super().__init__()
        self.worlds = [self._world(sleep=True), self._world(sleep=False)]
        self.level = 0.0
        self.names: dict[str, int] = {}
        self.made = 0

    @staticmethod
    def _world(*, sleep: bool) -> World:
        terrain = Terrain()
        terrain.put("west", HeightMap(FLAT[:, :31], resolution=SPACING, origin=(-3.0, -3.0)))
        terrain.put("east", HeightMap(FLAT[:, 30:], resolution=SPACING, origin=(0.0, -3.0)))
        return World(terrain, WorldConfig(physics=PhysicsConfig(sleep=sleep)))

    def teardown(self) -> None:
        for world in self.worlds:
            world.close()

    def place(self, cell: int, above: float = 0.0) -> tuple[float, float, float]:
        """The middle of one of nine cells that boxes cannot leave within a step of the machine."""
        return 1.6 * (cell % 3) - 1.6, 1.6 * (cell // 3) - 1.6, self.level + 0.1 + above

    @precondition(lambda self: len(self.names) < 9)
    @rule(data=st.data(), above=st.sampled_from([0.0, 0.2]))
    def spawn(self, data: Any, above: float) -> None:
        cell = data.draw(st.sampled_from(sorted(set(range(9)) - set(self.names.values()))))
        name = f"box_{self.made}"
        self.made += 1
        for world in self.worlds:
            world.spawn(name, BOX, 1.0, BodyState(self.place(cell, above)))
        self.names[name] = cell

    @precondition(lambda self: self.names)
    @rule(data=st.data())
    def remove(self, data: Any) -> None:
        name = data.draw(st.sampled_from(sorted(self.names)))
        for world in self.worlds:
            world.remove(name)
        del self.names[name]

    @precondition(lambda self: self.names)
    @rule(data=st.data(), speed=st.sampled_from([0.0, 0.4]))
    def put_back(self, data: Any, speed: float) -> None:
        name = data.draw(st.sampled_from(sorted(self.names)))
        for world in self.worlds:
            world.move(name, BodyState(self.place(self.names[name]), linear=(speed, 0.0, 0.0)))

    @rule(change=st.sampled_from([-0.05, -1e-4, 1e-4, 0.002, 0.05]))
    def new_maps(self, change: float) -> None:
        self.level += change
        for world in self.worlds:
            for mesh in world.terrain.tiles.values():
                mesh.replace(np.full_like(mesh.heights, self.level), time=world.time)

    @rule(row=st.integers(0, 40))
    def same_region(self, row: int) -> None:
        for world in self.worlds:
            for mesh in world.terrain.tiles.values():
                mesh.update_region(row, 3, mesh.heights[row : row + 9, 3:12], time=world.time)

    @rule()
    def tile_again(self) -> None:
        """A tile is taken away and another of its name put there, at the same height."""
        for world in self.worlds:
            world.terrain.remove("east")
            again = np.full((SIDE, 31), self.level, np.float32)
            world.terrain.put("east", HeightMap(again, resolution=SPACING, origin=(0.0, -3.0), time=world.time))

    @rule()
    def clock_back(self) -> None:
        for world in self.worlds:
            world.reset_time()

    @rule(steps=st.sampled_from([1, 30]))
    def step(self, steps: int) -> None:
        for world in self.worlds:
            world.step(steps)

    @precondition(lambda self: self.names)
    @rule()
    def fall_asleep(self) -> None:
        for world in self.worlds:
            world.step(RATE)

    @invariant()
    def same_places(self) -> None:
        sleeping, awake = self.worlds
        for name in self.names:
            here, there = (world.state(name).position for world in (sleeping, awake))
            assert math.dist(here, there) < 2e-3, f"{name} is at {here}, awake at {there}"


def test_sleeping_and_waking_bodies_are_where_awake_ones_are() -> None:
    run_state_machine_as_test(SleepingBesideAwake, settings=settings(examples(40), stateful_step_count=20))
