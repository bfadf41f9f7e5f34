"""Patches together with the bodies they are chosen for, for tests without a physics world."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np

from smartmesh_ros import HeightMap
from smartmesh_ros.patches.shapes import BODY_COLUMNS, ball
from smartmesh_ros.report.batch import PatchBatch
from smartmesh_ros.report.config import ReportConfig
from smartmesh_ros.report.patches import ChosenPatches
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import BoolArray
from tests.bodies import shapes_of

SOLID = ReportConfig(kind="trimesh")  # whose patches have the extent that the body's size asks for


class Selecting:
    """Balls of ``radii`` (N,) [m] in the first slots of `ChosenPatches`; those that are not ``solid`` get patches when
    asked for."""

    def __init__(
        self, ground: HeightMap, radii: Iterable[float], config: ReportConfig = SOLID, solid: BoolArray | None = None
    ) -> None:
        shapes = shapes_of(ball(radius) for radius in radii)
        solid = np.ones(len(shapes.table), bool) if solid is None else solid
        self._followers: Any = SimpleNamespace(
            tables=[], shape_table=shapes, capacity=len(shapes.table), solid=np.flatnonzero(solid),
            tracked=np.flatnonzero(~solid),
        )  # fmt: skip
        self.patches = ChosenPatches(ground, config, self._followers, Stopwatch())

    def update(
        self, positions: np.ndarray, speed: float = 0.0, time: float = 0.0, duration: float = 1.0 / 240.0
    ) -> list[PatchBatch]:
        """Patches of solid bodies at positions (N, 3) [m] that move along x [m/s]."""
        states = np.zeros((len(positions), BODY_COLUMNS))
        states[:, :3], states[:, 6], states[:, 7] = positions, 1.0, speed
        self._followers.states = states
        self.patches.refresh(time, duration)
        return self.patches.batches
