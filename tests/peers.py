"""Several worlds in one process that exchange the states of their bodies, with delay."""

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from smartmesh_ros import BodyState, HeightMap, PhysicsConfig, World, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.world.settings import GuestConfig
from smartmesh_ros.world.state_table import StateTable
from smartmesh_ros.world.states import SimulatedStates

RATE = 240.0
USUAL, GUESTS = PhysicsConfig(rate=RATE), GuestConfig()


class Start(NamedTuple):
    """A body: its shape, its mass [kg], where and how fast along x it starts [m, m/s], without spin."""

    shape: Shape
    mass: float
    x: float
    speed: float
    z: float


def flat_world(physics: PhysicsConfig = USUAL, guests: GuestConfig = GUESTS) -> World:
    """A world on flat ground."""
    ground = HeightMap(np.zeros((41, 161)), resolution=0.25, origin=(-20.0, -5.0))
    return World(ground, WorldConfig(physics=physics, guests=guests))


class Peers:
    """Worlds that step together and exchange the states of their bodies after ``late`` steps."""

    def __init__(self, count: int, late: int, physics: PhysicsConfig, guests: GuestConfig) -> None:
        self.worlds = [flat_world(physics, guests) for _ in range(count)]
        self._late = late
        self._mail: deque[list[tuple[StateTable, float]]] = deque()

    def step(self, count: int = 1) -> None:
        """Steps all worlds."""
        for _ in range(count):
            self.tell()
            for world in self.worlds:
                world.step()

    def tell(self) -> None:
        """Deliver the delayed states to each world."""
        self._mail.append([(SimulatedStates(world).read(), world.time) for world in self.worlds])
        if len(self._mail) <= self._late:
            return
        for teller, (states, time) in enumerate(self._mail.popleft()):
            for hearer, world in enumerate(self.worlds):
                if hearer != teller:
                    world.guests.take(f"world {teller}", states, time)

    def state(self, name: str) -> BodyState:
        """A body as its owner has it."""
        [world] = [world for world in self.worlds if name in world.bodies and world.bodies[name].simulated]
        return world.state(name)


@contextmanager
def peers(
    starts: list[list[Start]], late: int, physics: PhysicsConfig = USUAL, guests: GuestConfig = GUESTS, *,
    seed: int | None = None,
) -> Iterator[Peers]:  # fmt: skip
    """A world for each list of bodies, which are called ``b0``, ``b1``, ... all through. ``seed``: the worlds step at
    different instants, as nodes do; bodies start where they would be then."""
    made = Peers(len(starts), late, physics, guests)
    number = 0
    share = np.zeros(len(starts)) if seed is None else np.random.default_rng(seed).random(len(starts))
    for world, bodies, phase in zip(made.worlds, starts, share.tolist(), strict=True):
        world.time = phase * world.dt
        for body in bodies:
            state = BodyState((body.x + body.speed * world.time, 0.0, body.z), linear=(body.speed, 0.0, 0.0))
            world.spawn(f"b{number}", body.shape, body.mass, state)
            number += 1
    try:
        yield made
    finally:
        for world in made.worlds:
            world.close()
