"""States of all simulated bodies at once, as arrays."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.physics.bodies import Body
from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.state_table import StateTable
from smartmesh_ros.physics.world import World

NOWHERE = np.empty((0, 13))


class SimulatedStates:
    """Reads the states of the simulated bodies of a world, in the order they were spawned. What else there is to say of
    them is worked out only when one came or went: it would take as long as the states themselves."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._followers = world.followers
        self._describe()

    def read(self) -> StateTable:
        """The states as they are now."""
        if self._world.followers is not self._followers:
            self._describe()
        return self._bodies._replace(numbers=BulletCalls(self._world.client).states(self._uids))

    def _describe(self) -> None:
        self._followers = self._world.followers
        bodies = [body for body in self._world.bodies.values() if body.simulated]
        self._uids = [body.uid for body in bodies]
        self._bodies = _table(bodies)


def simulated_states(world: World) -> StateTable:
    """States of the simulated bodies of a world, in the order they were spawned."""
    return SimulatedStates(world).read()


def _table(bodies: list[Body]) -> StateTable:
    """What there is to say of bodies beside where they are."""
    forms = [body.form for body in bodies]
    return StateTable(
        [body.name for body in bodies], NOWHERE, np.array([body.radius for body in bodies]),
        np.array([form.kind for form in forms], np.uint8), np.array([form.dimensions for form in forms]).reshape(-1, 3),
        np.array([form.centre for form in forms]).reshape(-1, 3), np.array([body.mass for body in bodies]),
    )  # fmt: skip
