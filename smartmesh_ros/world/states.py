"""States of all simulated bodies of a world at once."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.shapes import padded_dimensions
from smartmesh_ros.ground.state import BODY_COLUMNS
from smartmesh_ros.ground.transform import IDENTITY
from smartmesh_ros.world.bodies import Body
from smartmesh_ros.world.link_frames import frame_pose
from smartmesh_ros.world.state_table import StateTable
from smartmesh_ros.world.world import World


class SimulatedStates:
    """Reads the states of a world's simulated bodies, in the order of spawning. Names, shapes and masses are read only
    when a body is added or removed, because reading them takes as long as reading the states."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._describe()

    def read(self) -> StateTable:
        """Return the current states."""
        followers = self._world.followers
        if (self._world.client, followers.epoch) != self._described:
            self._describe()
        numbers = self._world.ground.contacts.states_of(self._slots)
        # A robot's first attached link may not be its base.
        numbers[self._robots] = BulletCalls(self._world.client).states(self._uids)
        for row, body in self._askew:
            numbers[row, 3:7] = frame_pose(numbers[row, :7], body.axes)[3:]
        return self._bodies._replace(numbers=numbers)

    def _describe(self) -> None:
        followers = self._world.followers
        self._described = self._world.client, followers.epoch
        bodies = [body for body in self._world.bodies.values() if body.simulated]
        self._slots = np.array([followers.of(body.uid)[0] for body in bodies], np.int64)
        self._robots = np.array([body.is_robot for body in bodies], bool)
        self._uids = [body.uid for body in bodies if body.is_robot]
        self._askew = [(row, body) for row, body in enumerate(bodies) if body.axes != IDENTITY]
        self._bodies = body_table(bodies)


def body_table(bodies: list[Body]) -> StateTable:
    """Return a table of the constant data of bodies, without states."""
    shapes = [body.outline for body in bodies]
    radii, masses = np.array([(body.radius, body.mass) for body in bodies], np.float64).reshape(-1, 2).T.copy()
    dimensions = np.array([padded_dimensions(shape) for shape in shapes], np.float64).reshape(-1, 3)
    centres = np.array([shape.centre for shape in shapes], np.float64).reshape(-1, 3)
    kinds = np.array([shape.kind for shape in shapes], np.uint8)
    names, nowhere = [body.name for body in bodies], np.empty((0, BODY_COLUMNS))
    return StateTable(names, nowhere, radii, kinds, dimensions, centres, masses)
