"""A selector together with the bodies it chooses for, for tests without a physics world."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.ground.selector import Selector
from smartmesh_ros.patches.batch import PatchBatch
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.patches.shapes import ShapeTable
from smartmesh_ros.terrain.grid import BoolArray, FloatArray
from smartmesh_ros.terrain.terrain import Terrain


class Selecting:
    """Bodies of ``shapes`` (N,) in the first slots of a `Selector`; those that are not ``solid`` get patches of fixed
    extent when asked for."""

    def __init__(
        self, terrain: Terrain, config: PatchConfig, shapes: ShapeTable, solid: BoolArray | None = None
    ) -> None:
        self.terrain = terrain
        self.selector = Selector(terrain, config)
        self._count = len(shapes.table)
        self.selector.grow(self._count)
        self._shapes = shapes
        self._solid = np.ones(self._count, bool) if solid is None else solid
        self._last: Any = None

    @property
    def supports(self) -> Any:
        return self.selector.supports[: self._count]

    def update(self, bodies: FloatArray, time: float, duration: float) -> None:
        self._last = bodies, time, duration
        self.selector.update(np.flatnonzero(self._solid), self._shapes, bodies, time, duration)

    def batches(self) -> list[PatchBatch]:
        if not self._solid.all():
            bodies, time, duration = self._last
            self.selector.update(np.flatnonzero(~self._solid), self._shapes, bodies, time, duration)
        return self.selector.batches()
