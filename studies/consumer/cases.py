"""Cases of the consumer study, and the true ground of each case at any time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.scenes.elevation import jacksboro_fault
from smartmesh_ros.scenes.moving import Wave
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.tools.evaluation.distance import Surface

Source = Literal["patches", "map"]
SceneName = Literal["waves", "elevation"]

WAVE = Wave(amplitude=0.3, number=1.0, frequency=1.0)
# Height of the elevation model from its lowest to its highest sample [m].
RELIEF = 1.0
FRAME = "map"
COLLIDER = "/terrain_collider"


@dataclass(frozen=True, kw_only=True)
class Case:
    """One drive of ``seconds`` [s]. ``source``: whether MuJoCo takes served patches or whole maps. ``side``: samples on
    a side of the map of waves, ``resolution`` [m] apart; the elevation model brings its own number. ``map_rate`` [Hz].
    ``start`` [s]: the instant on the system's clock at which the ground's time is zero."""

    source: Source
    scene: SceneName
    side: int = 241
    resolution: float = 0.1
    map_rate: float = 30.0
    seconds: float = 20.0
    start: float = 0.0

    @property
    def name(self) -> str:
        """What a table calls it."""
        what = "waves" if self.scene == "waves" else "elevation model"
        return f"{what}, {100 * self.resolution:g} cm, {self.map_rate:g} Hz"

    def parameters(self) -> dict[str, float | str]:
        """Of the node that serves patches."""
        return {"patch.kind": "heightfield", "publish.collider_patches": 120.0}


class TrueGround:
    """The true ground of a case, centred on the frame's origin."""

    def __init__(self, case: Case) -> None:
        self._wave = WAVE if case.scene == "waves" else Wave(amplitude=0.0)
        self._start = case.start
        if case.scene == "waves":
            self._relief = np.zeros((case.side, case.side), np.float32)
        else:
            self._relief = jacksboro_fault(RELIEF)
        rows, columns = self._relief.shape
        step = case.resolution
        origin = (-0.5 * (columns - 1) * step, -0.5 * (rows - 1) * step, 0.0)
        self.geometry = GridGeometry(rows=rows, columns=columns, resolution=step, origin=origin)
        phase = self._wave.number * np.hypot(*np.moveaxis(self._places(0, 0, rows, columns), -1, 0))
        self._sin, self._cos = np.sin(phase).astype(np.float32), np.cos(phase).astype(np.float32)

    def heights(self, now: float) -> NDArray[np.float32]:
        """The whole map (rows, columns) [m] at ``now`` [s] of the system's clock."""
        return self._part(slice(None), slice(None), now)

    def around(self, points_w: FloatArray, reach: float, now: float) -> Surface:
        """The part of the ground within ``reach`` [m] of points (N, 3) [m] at ``now`` [s]."""
        geometry = self.geometry
        grid, margin = geometry.to_grid(points_w[:, :2]), reach / geometry.resolution + 1.0
        shape = np.array(self._relief.shape)
        low = np.clip(np.floor(grid.min(axis=0) - margin), 0, shape - 3).astype(int)
        high = np.clip(np.ceil(grid.max(axis=0) + margin) + 1, low + 3, shape).astype(int)
        heights = self._part(slice(low[0], high[0]), slice(low[1], high[1]), now)
        x, y = geometry.to_world(float(low[0]), float(low[1])).tolist()
        part = GridGeometry(
            rows=heights.shape[0], columns=heights.shape[1], resolution=geometry.resolution, origin=(x, y, 0.0)
        )
        return Surface(part, heights.astype(np.float64))

    def _part(self, rows: slice, columns: slice, now: float) -> NDArray[np.float32]:
        amplitude, turn = self._wave.amplitude, self._wave.frequency * (now - self._start)
        part: NDArray[np.float32] = self._relief[rows, columns].copy()
        if amplitude:
            part += self._sin[rows, columns] * np.float32(amplitude * math.cos(turn))
            part += self._cos[rows, columns] * np.float32(amplitude * math.sin(turn))
        return part

    def _places(self, row: int, column: int, rows: int, columns: int) -> FloatArray:
        r, c = np.mgrid[row : row + rows, column : column + columns]
        return self.geometry.to_world(r, c)
