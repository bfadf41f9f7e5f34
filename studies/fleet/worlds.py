"""Several worlds in one process that exchange the states of their bodies, with delay and loss."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from smartmesh_ros import BodyState, HeightMap, PhysicsConfig, World, WorldConfig
from smartmesh_ros.ground.shapes import Shape
from smartmesh_ros.world.guest_config import GuestConfig
from smartmesh_ros.world.state_table import StateTable
from smartmesh_ros.world.states import simulated_states

RATE = 240.0


# Radius of a rover's wheels [m].
WHEEL = 0.15


class Start(NamedTuple):
    """A body: its shape, None = a rover, whose wheels go on turning; its mass [kg], where and how fast along x it
    starts [m, m/s], without spin."""

    shape: Shape | None
    mass: float
    x: float
    speed: float
    z: float
    y: float = 0.0


def flat_world(physics: PhysicsConfig, guests: GuestConfig | None = None) -> World:
    """A world on flat ground."""
    ground = HeightMap(np.zeros((41, 161)), resolution=0.25, origin=(-20.0, -5.0))
    return World(ground, WorldConfig(physics=physics, guests=guests or GuestConfig()))


class Peers:
    """Worlds that step together and exchange the states of their bodies after ``late`` steps; a fraction ``loss`` of
    the messages is dropped."""

    def __init__(
        self,
        count: int,
        late: int,
        physics: PhysicsConfig,
        guests: GuestConfig | None = None,
        *,
        loss: float = 0.0,
        seed: int = 0,
    ) -> None:
        self._loss, self._rng = loss, np.random.default_rng(seed)
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
        self._mail.append([(simulated_states(world), world.time) for world in self.worlds])
        if len(self._mail) <= self._late:
            return
        for teller, (states, time) in enumerate(self._mail.popleft()):
            for hearer, world in enumerate(self.worlds):
                if hearer != teller and self._rng.random() >= self._loss:
                    world.guests.take(f"world {teller}", states, time)

    def state(self, name: str) -> BodyState:
        """A body as its owner has it."""
        [world] = [world for world in self.worlds if name in world.bodies and world.bodies[name].simulated]
        return world.state(name)


@contextmanager
def peers(
    starts: list[list[Start]],
    late: int,
    physics: PhysicsConfig | None = None,
    guests: GuestConfig | None = None,
    *,
    loss: float = 0.0,
    seed: int = 0,
    phases: bool = False,
) -> Iterator[Peers]:
    """A world for each list of bodies, which are called ``b0``, ``b1``, ... all through. ``phases``: whether the worlds
    step at different instants, as nodes do; bodies start where they would be then."""
    made = Peers(len(starts), late, physics or PhysicsConfig(rate=RATE), guests, loss=loss, seed=seed)
    number = 0
    share = np.random.default_rng(seed).random(len(starts)) if phases else np.zeros(len(starts))
    for world, bodies, phase in zip(made.worlds, starts, share.tolist(), strict=True):
        world.time = phase * world.config.physics.dt
        for body in bodies:
            spawn(world, f"b{number}", body._replace(x=body.x + body.speed * world.time))
            number += 1
    try:
        yield made
    finally:
        for world in made.worlds:
            world.close()


def spawn(world: World, name: str, body: Start) -> None:
    """Adds a body."""
    state = BodyState((body.x, body.y, body.z), linear=(body.speed, 0.0, 0.0))
    if body.shape is not None:
        world.spawn(name, body.shape, body.mass, state)
        return
    world.spawn_robot(name, rover(body.mass), state)
    for joint in world.bodies[name].joints:
        world.drive(name, joint, body.speed / WHEEL)


def rover(mass: float) -> str:
    """The URDF of a frame of such a ``mass`` [kg] on four wheels of 1 kg."""
    wheels = [(x, y) for x in (-0.3, 0.3) for y in (-0.25, 0.25)]
    links = [_link("frame", mass, 0.3, '<origin xyz="0 0 0.1"/><geometry><box size="0.7 0.35 0.1"/></geometry>')]
    links += [_link(f"wheel_{k}", 1.0, 0.01, f'<geometry><sphere radius="{WHEEL}"/></geometry>') for k in range(4)]
    joints = [
        f'<joint name="axle_{k}" type="continuous"><parent link="frame"/><child link="wheel_{k}"/>'
        f'<origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/><limit effort="30" velocity="50"/></joint>'
        for k, (x, y) in enumerate(wheels)
    ]
    return f'<robot name="rover">{"".join(links + joints)}</robot>'


def _link(name: str, mass: float, inertia: float, shape: str) -> str:
    spins = f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/>{spins}</inertial><collision>{shape}</collision></link>'
    )
