"""Simulated moving terrain: heights as functions of time; and a real elevation model."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, Region

FloatGrid = NDArray[np.float32]


class Scene(ABC):
    """A moving surface on a grid. `heights` returns the whole map at a time, `changed` the part that moves then."""

    def __init__(self, geometry: GridGeometry) -> None:
        self.geometry = geometry
        columns = np.arange(geometry.columns, dtype=np.float32) * np.float32(geometry.resolution)
        rows = np.arange(geometry.rows, dtype=np.float32) * np.float32(geometry.resolution)
        # Positions on the grid relative to the middle of the map [m].
        self.x = columns - columns[-1] / 2
        self.y = (rows - rows[-1] / 2)[:, None]

    @abstractmethod
    def heights(self, time: float) -> FloatGrid:
        """Return the whole map (rows, columns) [m] at ``time`` [s]."""

    def changed(self, time: float) -> Region:
        """Return the region that moves at ``time`` [s]; by default the whole map."""
        return Region(0, 0, self.heights(time))

    def _window(self, x: float, y: float, reach: float) -> tuple[slice, slice]:
        """Return the rows and columns within ``reach`` [m] of a point, at least one of each."""
        step = self.geometry.resolution
        slices = []
        for centre, first, count in (
            (y, float(self.y[0, 0]), self.geometry.rows),
            (x, float(self.x[0]), self.geometry.columns),
        ):
            low = int(np.clip(math.floor((centre - reach - first) / step), 0, count - 1))
            high = int(np.clip(math.ceil((centre + reach - first) / step) + 1, low + 1, count))
            slices.append(slice(low, high))
        return slices[0], slices[1]


@dataclass(frozen=True)
class Wave:
    """A wave of amplitude [m], wave number [rad/m] and angular frequency [rad/s]."""

    amplitude: float = 0.3
    number: float = 1.0
    frequency: float = 2.0


class InwardWaves(Scene):
    """The report's terrain (Figure 1): circular waves that travel towards the middle of the map; on a fixed ``relief``
    (rows, columns) [m], if there is one."""

    def __init__(self, geometry: GridGeometry, wave: Wave | None = None, relief: FloatGrid | float = 0.0) -> None:
        super().__init__(geometry)
        self.wave, self.relief = wave or Wave(), relief
        phase = np.hypot(self.x, self.y) * np.float32(self.wave.number)
        # sin(a + b) = sin a cos b + cos a sin b avoids trigonometric functions per sample and frame.
        self._sin, self._cos = np.sin(phase), np.cos(phase)

    def heights(self, time: float) -> FloatGrid:
        turn = self.wave.frequency * time
        amplitude = self.wave.amplitude
        heights: FloatGrid = self._sin * np.float32(amplitude * math.cos(turn))
        heights += self._cos * np.float32(amplitude * math.sin(turn))
        heights += self.relief
        return heights


class Level(Scene):
    """Flat ground at the height ``level`` [m] of the time [s]."""

    def __init__(self, geometry: GridGeometry, level: Callable[[float], float]) -> None:
        super().__init__(geometry)
        self.level = level

    def heights(self, time: float) -> FloatGrid:
        return np.full((self.geometry.rows, self.geometry.columns), self.level(time), np.float32)


class Crater(Scene):
    """A crater with a raised rim that opens in the middle of flat ground within ``duration`` [s]."""

    def __init__(self, geometry: GridGeometry, radius: float = 2.0, depth: float = 0.6, duration: float = 3.0) -> None:
        super().__init__(geometry)
        self.duration = duration
        self._rows, self._columns = self._window(0.0, 0.0, 3.0 * radius)
        r = np.hypot(self.x[self._columns], self.y[self._rows]) / radius
        self._bowl = (depth * (r**2 - 1.0) * np.exp(-(r**2))).astype(np.float32)

    def heights(self, time: float) -> FloatGrid:
        whole = np.zeros((self.geometry.rows, self.geometry.columns), np.float32)
        whole[self._rows, self._columns] = self.changed(time).heights
        return whole

    def changed(self, time: float) -> Region:
        share = float(np.clip(time / self.duration, 0.0, 1.0))
        smooth = share * share * (3.0 - 2.0 * share)
        return Region(self._rows.start, self._columns.start, self._bowl * np.float32(smooth))


class Rut(Scene):
    """A rut that a wheel presses into the ground along a circle; the ground stays deformed."""

    def __init__(
        self, geometry: GridGeometry, radius: float = 3.0, speed: float = 1.0, width: float = 0.4, depth: float = 0.12
    ) -> None:
        super().__init__(geometry)
        self.radius, self.speed, self.width, self.depth = radius, speed, width, depth
        self._ground = np.zeros((geometry.rows, geometry.columns), np.float32)
        self._time = 0.0

    def wheel(self, time: float) -> tuple[float, float]:
        """Return the position (x, y) of the wheel relative to the middle of the map [m]."""
        angle = self.speed * time / self.radius
        return self.radius * math.cos(angle), self.radius * math.sin(angle)

    def heights(self, time: float) -> FloatGrid:
        self.changed(time)
        return self._ground.copy()

    def changed(self, time: float) -> Region:
        """Press the ground down along the wheel's path since the last call; return the region around the wheel."""
        if time < self._time:
            self._ground[:] = 0.0
            self._time = 0.0
        lap = math.tau * self.radius / self.speed  # a second one over the same circle presses no deeper
        begin = max(self._time, time - lap)
        steps = max(1, math.ceil((time - begin) * self.speed / (0.25 * self.width)))
        for moment in np.linspace(begin, time, steps + 1)[1:]:
            x, y = self.wheel(float(moment))
            rows, columns = self._window(x, y, 1.5 * self.width)
            distance = np.hypot(self.x[columns] - np.float32(x), self.y[rows] - np.float32(y)) / self.width
            pressed = np.float32(-self.depth) * np.exp(-((2.0 * distance) ** 2))
            np.minimum(self._ground[rows, columns], pressed, out=self._ground[rows, columns])
        self._time = time
        x, y = self.wheel(time)
        rows, columns = self._window(x, y, 2.5 * self.width + self.speed * 0.2)
        return Region(rows.start, columns.start, self._ground[rows, columns].copy())


def jacksboro_fault(relief: float) -> NDArray[np.float32]:
    """Return the Jacksboro fault, from Matplotlib's sample data: elevations (344, 403) scaled to 0 .. ``relief`` [m],
    rows northwards along +y. Raises `InputError` if Matplotlib is not installed."""
    try:
        from matplotlib.cbook import get_sample_data
    except ModuleNotFoundError:
        raise InputError("missing", "the elevation model needs Matplotlib: pip install matplotlib") from None
    data: Any = get_sample_data("jacksboro_fault_dem.npz")
    with data:
        elevation = np.asarray(data["elevation"], np.float32)[::-1]  # the file's rows run southwards
    low, high = float(elevation.min()), float(elevation.max())
    return np.ascontiguousarray((elevation - low) * np.float32(relief / (high - low)), np.float32)


def resampled(heights: FloatGrid, rows: FloatArray, columns: FloatArray) -> FloatArray:
    """Return heights [m] interpolated bilinearly at fractional ``rows`` (n,) and ``columns`` (m,), shape (n, m)."""
    across = [np.interp(columns, np.arange(heights.shape[1]), row) for row in heights]
    return np.array([np.interp(rows, np.arange(heights.shape[0]), column) for column in np.transpose(across)]).T
