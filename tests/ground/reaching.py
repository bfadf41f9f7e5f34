"""Patches of bodies, for tests without a physics world."""

from collections.abc import Iterable

import numpy as np

from smartmesh_ros import Terrain
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.ground.followers import Follower, Followers
from smartmesh_ros.ground.shown_patches import PatchTable, ShownPatches
from smartmesh_ros.ground.state import BODY_COLUMNS
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray
from smartmesh_ros.terrain.terrain import MainMesh


class Reaching:
    """Bodies of ``shapes`` (n,) in the first slots. Those that are not ``solid`` (n,) have patches at any height."""

    def __init__(self, ground: MainMesh | Terrain, shapes: Iterable[BodyShape], solid: BoolArray | bool = True) -> None:
        known, self.followers = list(shapes), Followers()
        for body, is_solid in enumerate(np.broadcast_to(solid, len(known)).tolist()):
            self.followers.add(Follower(body, -1, known[body], is_solid), own=True)
        self.patches = ShownPatches(Terrain.of(ground), self.followers, Stopwatch())

    def at(self, positions: FloatArray, time: float = 0.0, speed: float = 0.0) -> PatchTable:
        """Patches of bodies at positions (n, 3) [m] that move along x [m/s]."""
        states = np.zeros((self.followers.capacity, BODY_COLUMNS))
        states[: len(positions), :3], states[:, 6], states[:, 7] = positions, 1.0, speed
        self.patches.find(states, time)
        return self.patches.table()


def balls_on(ground: MainMesh | Terrain, radii: Iterable[float], solid: BoolArray | bool = True) -> Reaching:
    """Balls of these radii [m]."""
    return Reaching(ground, [BodyShape.ball(radius) for radius in radii], solid)
