"""Patches together with the bodies they are chosen for, for tests without a physics world."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np

from smartmesh_ros import HeightMap, Terrain
from smartmesh_ros.patches.shapes import BODY_COLUMNS, ShapeTable, ball
from smartmesh_ros.report.batch import PatchBatch
from smartmesh_ros.report.chosen_patches import ChosenPatches
from smartmesh_ros.report.config import ReportConfig
from smartmesh_ros.stopwatch import Stopwatch
from smartmesh_ros.terrain.grid import FloatArray
from tests.bodies import shapes_of

SOLID = ReportConfig(kind="trimesh")  # whose patches have the extent that the body's size asks for


class Selecting:
    """Bodies of ``shapes`` (N,) in the first slots of `ChosenPatches`."""

    def __init__(self, terrain: Terrain, config: ReportConfig, shapes: ShapeTable) -> None:
        self.terrain = terrain
        self._count = len(shapes.table)
        self._followers: Any = SimpleNamespace(shape_table=shapes, solid=np.arange(self._count), tracked=np.arange(0))
        self._patches = ChosenPatches(terrain, config, self._followers, Stopwatch())

    @property
    def supports(self) -> Any:
        return self._patches.supports[: self._count]

    def update(self, bodies: FloatArray, time: float, duration: float) -> None:
        self._patches.begin(time, duration, bodies)
        assert len(self.supports) == self._count

    def batches(self) -> list[PatchBatch]:
        self._patches.choose_tracked()
        return self._patches.batches


def balls_on(ground: HeightMap | Terrain, radii: Iterable[float], config: ReportConfig = SOLID) -> Selecting:
    """Balls of these radii [m]."""
    return Selecting(Terrain.of(ground), config, shapes_of(ball(radius) for radius in radii))


def update(selector: Selecting, positions: FloatArray, speed: float = 0.0, time: float = 0.0) -> list[PatchBatch]:
    """Patches of bodies at positions (N, 3) [m] that move along x [m/s]."""
    bodies = np.zeros((len(positions), BODY_COLUMNS))
    bodies[:, :3], bodies[:, 6], bodies[:, 7] = positions, 1.0, speed
    selector.update(bodies, time, 1.0 / 240.0)
    return selector.batches()
