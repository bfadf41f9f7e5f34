"""A digest of a run, by which two runs are told equal."""

from __future__ import annotations

import hashlib

import numpy as np

from smartmesh_ros.world.states import SimulatedStates
from smartmesh_ros.world.world import World

# Steps from one reading of the world to the next: reading takes as long as a step, and a state follows from all before.
EVERY = 8


class Digest:
    """SHA-256 of the states of all simulated bodies and joints, and of the contacts with the ground, after every eighth
    step and at the end."""

    def __init__(self, world: World) -> None:
        self._world, self._states = world, SimulatedStates(world)
        self._sum = hashlib.sha256()
        self._count, self._time = 0, world.time

    def note(self) -> None:
        """Take note of a step, if there was one since the last call."""
        if self._world.time == self._time:
            return
        self._count, self._time = self._count + 1, self._world.time
        if self._count % EVERY == 0:
            self._sum.update(self._read())

    def hexadecimal(self) -> str:
        """Return the digest of the run so far, 64 digits."""
        found = self._sum.copy()
        found.update(self._read())
        return found.hexdigest()

    def _read(self) -> bytes:
        world, states = self._world, self._states.read()
        robots = [name for name, body in world.bodies.items() if body.is_robot]
        joints = [(joint.position, joint.velocity) for robot in robots for joint in world.joints(robot)]
        numbers = states.numbers.tobytes() + np.array(joints, np.float64).tobytes()
        return repr((world.time, states.names, world.contacts())).encode() + numbers
