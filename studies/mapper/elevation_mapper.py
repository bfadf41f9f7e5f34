"""A small elevation mapper: a grid around the rover whose cells are Kalman filters of one state, the height.

It knows nothing of the truth: it takes scans and estimated poses. Its cells lie on a lattice that stays where it is in
the map's frame - the middle of cell (row, column) is at (column, row) x resolution - and the grid scrolls over it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry, overlap
from studies.mapper.poses import Pose
from studies.mapper.sensors import Scan


@dataclass(frozen=True, kw_only=True)
class MapperConfig:
    """The map and its filter.

    ``cells``: on a side; ``resolution`` [m]; by default 8 m around a rover with 30 cm wheels. ``unevenness`` [m]:
    standard deviation of the ground within a cell about the height at its middle, since points hit it anywhere.
    ``growth`` [m^2/s]: variance that a second adds, for the pose drifts while the cell is not seen.
    ``least_deviation`` [m]: no height is known better than that, or the filter would stop listening.
    """

    cells: int = 80
    resolution: float = 0.1
    unevenness: float = 0.01
    growth: float = 1e-5
    least_deviation: float = 0.003


class ElevationMapper:
    """Heights and variances (cells, cells) around the rover, rows along +y; NaN where nothing was seen."""

    def __init__(self, config: MapperConfig) -> None:
        self.config = config
        self.heights: FloatArray = np.full((config.cells, config.cells), np.nan)
        self.variances: FloatArray = self.heights.copy()
        self.first = (0, 0)  # row and column, on the lattice, of cell (0, 0)

    @property
    def geometry(self) -> GridGeometry:
        """Where the middles of the cells lie."""
        cells, resolution = self.config.cells, self.config.resolution
        origin = (self.first[1] * resolution, self.first[0] * resolution, 0.0)
        return GridGeometry(rows=cells, columns=cells, resolution=resolution, origin=origin)

    def follow(self, estimate: Pose) -> None:
        """Scroll by whole cells until the rover is in the middle cell. New cells are unknown (NaN)."""
        first = self._around(estimate)
        moved = (first[0] - self.first[0], first[1] - self.first[1])
        self.heights, self.variances = _scrolled(self.heights, moved), _scrolled(self.variances, moved)
        self.first = first

    def wait(self, seconds: float) -> None:
        """Increase the variance of every height by the growth in this time."""
        self.variances += self.config.growth * seconds

    def add(self, scan: Scan, estimate: Pose) -> None:
        """Fuses the points of a scan, one after the other."""
        points = scan.points_b @ estimate.rotation.T + estimate.position
        downwards = scan.directions_b @ estimate.rotation[2]
        variances = (scan.deviations * downwards) ** 2 + self.config.unevenness**2
        places = points[:, 1::-1] / self.config.resolution - self.first
        _fuse(self.heights, self.variances, places, points[:, 2], variances, self.config.least_deviation**2)

    def correct(self, before: Pose, after: Pose) -> None:
        """Moves the whole map with the rover from one estimate of its pose to a better one, a closed loop's.

        Heights are shifted and, on the lattice, interpolated between those known; a cell whose nearest one is not known
        is not known afterwards.
        """
        first = self._around(after)
        turn, step = after.yaw - before.yaw, self.config.resolution
        cos, sin = math.cos(turn), math.sin(turn)
        cells = np.arange(self.config.cells)
        y = ((first[0] + cells) * step - after.y)[:, None]
        x = (first[1] + cells) * step - after.x
        rows = (before.y - sin * x + cos * y) / step - self.first[0]
        columns = (before.x + cos * x + sin * y) / step - self.first[1]
        self.heights, self.variances = (
            _resampled(self.heights, rows, columns),
            _resampled(self.variances, rows, columns),
        )
        self.heights += after.z - before.z
        self.first = first

    def _around(self, estimate: Pose) -> tuple[int, int]:
        """The first cell of a grid around the rover."""
        step, half = self.config.resolution, self.config.cells // 2
        return round(estimate.y / step) - half, round(estimate.x / step) - half


def _scrolled(cells: FloatArray, moved: tuple[int, int]) -> FloatArray:
    """A grid that has moved by (rows, columns) over its cells; NaN where it had none."""
    result = np.full_like(cells, np.nan)
    new, old = zip(*(overlap(by, size) for by, size in zip(moved, cells.shape, strict=True)), strict=True)
    result[new] = cells[old]
    return result


def _fuse(
    heights: FloatArray,
    variances: FloatArray,
    places: FloatArray,
    measured: FloatArray,
    noises: FloatArray,
    least: float,
) -> None:
    """Fuses heights (N,) with variances ``noises`` (N,), measured at fractional (row, column) ``places`` (N, 2).

    One point after the other in each cell, and all cells at once.
    """
    cells = np.floor(places + 0.5).astype(np.int64)
    inside = np.flatnonzero(((cells >= 0) & (cells < heights.shape)).all(axis=1))
    flat = cells[inside, 0] * heights.shape[1] + cells[inside, 1]
    order = np.argsort(flat, kind="stable")
    of_cell, points = flat[order], inside[order]
    turns = np.arange(len(of_cell)) - np.searchsorted(of_cell, of_cell)
    known, spreads = heights.reshape(-1), variances.reshape(-1)
    for turn in range(turns.max(initial=-1) + 1):
        chosen = turns == turn
        at, new, noise = of_cell[chosen], measured[points[chosen]], np.maximum(noises[points[chosen]], least)
        first, total = np.isnan(known[at]), spreads[at] + noise
        gain = np.divide(spreads[at], total, out=np.ones_like(total), where=total > 0.0)
        known[at] = np.where(first, new, known[at] + gain * (new - known[at]))
        spreads[at] = np.where(first, noise, np.maximum(gain * noise, least))


def _resampled(values: FloatArray, rows: FloatArray, columns: FloatArray) -> FloatArray:
    """The bilinear mean of the four cells around fractional places, (n, n) each, as far as these cells are known; NaN
    where the nearest cell is not known."""
    r, c = np.floor(rows), np.floor(columns)
    total, weights = np.zeros_like(rows), np.zeros_like(rows)
    for i in range(2):
        for j in range(2):
            value = _values(values, r + i, c + j)
            weight = np.where(np.isnan(value), 0.0, (1.0 - abs(rows - r - i)) * (1.0 - abs(columns - c - j)))
            total += weight * np.nan_to_num(value)
            weights += weight
    unknown = np.isnan(_values(values, np.floor(rows + 0.5), np.floor(columns + 0.5)))
    return np.divide(total, weights, out=np.full_like(rows, np.nan), where=~unknown)


def _values(values: FloatArray, rows: FloatArray, columns: FloatArray) -> FloatArray:
    """Values of cells (n, n); NaN outside."""
    inside = (rows >= 0) & (rows < values.shape[0]) & (columns >= 0) & (columns < values.shape[1])
    found = values[np.where(inside, rows, 0).astype(np.int64), np.where(inside, columns, 0).astype(np.int64)]
    return np.where(inside, found, np.nan)
