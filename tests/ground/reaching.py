"""Patches of bodies, for tests without a physics world."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np

from smartmesh_ros import Terrain
from smartmesh_ros.ground.followers import FOLLOWER
from smartmesh_ros.ground.shown_patches import PatchTable, ShownPatches
from smartmesh_ros.patches.shapes import BODY_COLUMNS, BodyShape, ball
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray, FloatArray
from smartmesh_ros.terrain.terrain import MainMesh
from tests.bodies import shapes_of


class Numbered(SimpleNamespace):
    """Followers whose bodies have the numbers of their slots."""

    def __getitem__(self, slot: int) -> Any:
        return SimpleNamespace(body=slot)


class Reaching:
    """Bodies of ``shapes`` (n,) in the first slots. Those that are not ``solid`` (n,) have patches at any height."""

    def __init__(self, ground: MainMesh | Terrain, shapes: Iterable[BodyShape], solid: BoolArray | bool = True) -> None:
        table = shapes_of(shapes)
        count = len(table.table)
        followers: Any = Numbered(table=np.zeros(count, FOLLOWER), shape_table=table)
        followers.table["alive"], followers.table["solid"] = True, solid
        self.patches = ShownPatches(Terrain.of(ground), followers, Stopwatch())

    def at(self, positions: FloatArray, time: float = 0.0, speed: float = 0.0) -> PatchTable:
        """Patches of bodies at positions (n, 3) [m] that move along x [m/s]."""
        states = np.zeros((len(positions), BODY_COLUMNS))
        states[:, :3], states[:, 6], states[:, 7] = positions, 1.0, speed
        self.patches.find(states, time)
        return self.patches.table()


def balls_on(ground: MainMesh | Terrain, radii: Iterable[float], solid: BoolArray | bool = True) -> Reaching:
    """Balls of these radii [m]."""
    return Reaching(ground, [ball(radius) for radius in radii], solid)
