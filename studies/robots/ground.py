"""The ground of the robots' scenes."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.scenes.moving import FloatGrid, Scene, Wave
from smartmesh_ros.terrain.grid import GridGeometry

# A wave whose ground moves at up to 0.2 m/s and 0.8 m/s^2, upwards and downwards.
HEAVING = Wave(amplitude=0.05, number=1.0, frequency=4.0)
STILL = Wave(amplitude=0.0)


class RoughHills(Scene):
    """Hills of 0.1 m with independent normally distributed noise of standard ``deviation`` [m] at every sample, and a
    ``wave`` along x that carries all of it up and down."""

    def __init__(
        self, geometry: GridGeometry, wave: Wave = STILL, deviation: float = 0.01, hills: float = 0.1, seed: int = 0
    ) -> None:
        super().__init__(geometry)
        self.wave = wave
        noise = np.random.default_rng(seed).normal(0.0, deviation, (geometry.rows, geometry.columns))
        self._still: FloatGrid = (hills * np.sin(1.5 * self.x) * np.cos(1.1 * self.y) + noise).astype(np.float32)

    def heights(self, time: float) -> FloatGrid:
        wave = self.wave
        if wave.amplitude == 0.0:
            return self._still
        heave = np.float32(wave.amplitude) * np.sin(wave.number * self.x - np.float32(wave.frequency * time))
        heights: FloatGrid = self._still + heave.astype(np.float32)
        return heights
