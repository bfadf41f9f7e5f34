"""Patches together with the bodies they are chosen for, for tests without a physics world."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np

from smartmesh_ros import HeightMap
from smartmesh_ros.patches.shapes import BODY_COLUMNS, ball
from studies.report.batch import PatchBatch
from studies.report.config import ReportConfig
from studies.report.patches import ChosenPatches
from tests.bodies import shapes_of

SOLID = ReportConfig(kind="trimesh")  # whose patches have the extent that the body's size asks for


class Selecting:
    """Balls of ``radii`` (N,) [m] in the first slots of `ChosenPatches`."""

    def __init__(self, ground: HeightMap, radii: Iterable[float], config: ReportConfig = SOLID) -> None:
        shapes = shapes_of(ball(radius) for radius in radii)
        followers: Any = SimpleNamespace(shape_table=shapes, solid=np.arange(len(shapes.table)), tracked=np.arange(0))
        self.patches = ChosenPatches(ground, config, followers)

    def update(
        self, positions: np.ndarray, speed: float = 0.0, time: float = 0.0, duration: float = 1.0 / 240.0
    ) -> list[PatchBatch]:
        """Patches of solid bodies at positions (N, 3) [m] that move along x [m/s]."""
        states = np.zeros((len(positions), BODY_COLUMNS))
        states[:, :3], states[:, 6], states[:, 7] = positions, 1.0, speed
        self.patches.refresh(time, duration, states)
        return self.patches.batches
