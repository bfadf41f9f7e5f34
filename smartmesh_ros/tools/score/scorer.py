"""Scores of a mapper's maps against maps of the true ground. Without ROS."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap


@dataclass(frozen=True, kw_only=True)
class ScoreConfig:
    """Settings of a `Scorer`.

    ``longest_lag`` [s]: of a map behind the ground; above the true lag, and below the period of ground that oscillates.
    ``window`` [s]: time over whose maps the lag is estimated.
    """

    longest_lag: float = 2.0
    window: float = 10.0


# Number of lags that are tried, and most cells of a map that count for the lag.
LAGS, CELLS = 101, 500
# Largest part of the variance of errors at the worst lag that is left at the best one, so that the best one counts;
# where the ground hardly moves, all are as good.
LEFT = 0.5
# Time by which a map may come after the truth of its stamp, and before it [s].
LATE, AHEAD = 3.0, 1.0


class Score(NamedTuple):
    """What a map of the time ``stamp`` [s] is worth.

    ``rmse``, ``bias`` [m]: root mean square and mean of map minus truth, at the map's time, over its ``cells``, those
    that the truth has, too; NaN without such cells. ``covered``: share of the true ground for which the map has a
    height. ``delay`` [s]: time of the newest truth when the map came, minus the map's. ``lag`` [s]: how much older than
    its stamp the ground in a map is: the shift in time at which the maps of the window fit best, beside their bias; NaN
    = unknown. ``spread`` [m]: standard deviation of the errors at that lag.
    """

    stamp: float
    rmse: float
    bias: float
    covered: float
    cells: int
    delay: float
    lag: float
    spread: float


class _Map(NamedTuple):
    stamp: float
    heights: HeightMap
    newest: float  # truth when the map came [s]


class _Sums(NamedTuple):
    """Errors of a map at each lag: their number, sums and sums of squares."""

    stamp: float
    cells: int
    errors: FloatArray
    squares: FloatArray


class Scorer:
    """Compares maps with the truth at their time, linear between true maps before and after."""

    def __init__(self, config: ScoreConfig | None = None) -> None:
        self.config = config or ScoreConfig()
        self._lags = np.linspace(0.0, self.config.longest_lag, LAGS)
        self._truth: list[tuple[float, HeightMap]] = []
        self._waiting: deque[_Map] = deque()
        self._sums: deque[_Sums] = deque()

    def add_truth(self, stamp: float, raster: Raster) -> None:
        """Take the true ground at a time [s]. If time went back, what was before is forgotten."""
        if self._truth and stamp < self._truth[-1][0]:
            for known in (self._truth, self._waiting, self._sums):
                known.clear()
        oldest = min([stamp - self.config.longest_lag - LATE, *(map_.stamp for map_ in self._waiting)])
        first = bisect_right(self._truth, oldest, key=itemgetter(0)) - 1  # the last one before that
        self._truth = [(time, heights) for time, heights in self._truth[max(first, 0) :] if time < stamp]
        self._truth.append((stamp, HeightMap(raster.heights, geometry=raster.geometry)))

    def add_map(self, stamp: float, raster: Raster) -> None:
        """Take a map of a time [s]. Raises `InputError` if truth of that time is neither there nor to come."""
        if not self._truth:
            raise InputError("truth", "there is no true map yet to compare a map with")
        oldest, newest = self._truth[0][0], self._truth[-1][0]
        if stamp < oldest:
            raise InputError("late", f"a map is {oldest - stamp:.3g} s older than the oldest true map that is kept")
        if stamp > newest + AHEAD:
            words = f"a map is {stamp - newest:.3g} s ahead of the newest true map"
            raise InputError("ahead", f"{words}; let one clock stamp both, use_sim_time in all nodes or in none")
        self._waiting.append(_Map(stamp, HeightMap(raster.heights, geometry=raster.geometry), newest))

    def take(self) -> list[Score]:
        """Return the scores of the maps whose truth has come."""
        found = []
        while self._waiting and self._waiting[0].stamp <= self._truth[-1][0]:
            found.append(self._score(self._waiting.popleft()))
        return found

    def _score(self, map_: _Map) -> Score:
        places, heights = _cells(map_.heights)
        true = self._truth_at(places, np.array([map_.stamp]))[0]
        errors = (heights - true)[known := ~np.isnan(true)]
        rmse, bias = math.nan, math.nan
        if len(errors):
            rmse, bias = math.sqrt(float(np.mean(errors**2))), float(errors.mean())
            self._note_lags(map_.stamp, places[known], heights[known])
        before = [heights for time, heights in self._truth if time <= map_.stamp][-1]
        ground, _ = _cells(before)
        grid = map_.heights.geometry
        at = np.rint(grid.to_grid(ground)).astype(np.int64)
        rows, columns = at[((at >= 0) & (at <= grid.last)).all(axis=1)].T
        covered = int((~np.isnan(map_.heights.heights[rows, columns])).sum()) / max(len(ground), 1)
        return Score(map_.stamp, rmse, bias, covered, len(errors), map_.newest - map_.stamp, *self._lag())

    def _note_lags(self, stamp: float, places: FloatArray, heights: FloatArray) -> None:
        """Note the errors of some cells of a map at each lag, if the truth goes back so far."""
        while self._sums and not stamp - self.config.window <= self._sums[0].stamp <= stamp:
            self._sums.popleft()
        if stamp - self.config.longest_lag < self._truth[0][0]:
            return
        some = slice(None, None, math.ceil(len(places) / CELLS))
        errors = heights[some] - self._truth_at(places[some], stamp - self._lags)
        errors = errors[:, ~np.isnan(errors).any(axis=0)]
        self._sums.append(_Sums(stamp, errors.shape[1], errors.sum(axis=1), (errors**2).sum(axis=1)))

    def _lag(self) -> tuple[float, float]:
        """Return the lag [s], and the standard deviation of errors there [m]; NaN = unknown."""
        count = sum(sums.cells for sums in self._sums)
        if not count:
            return math.nan, math.nan
        mean = np.sum([sums.errors for sums in self._sums], axis=0) / count
        variances = np.maximum(np.sum([sums.squares for sums in self._sums], axis=0) / count - mean**2, 0.0)
        best = int(variances.argmin())
        if best == len(self._lags) - 1 or not variances[best] < LEFT * variances.max():
            return math.nan, math.nan
        lag, least = float(self._lags[best]), float(variances[best])
        if best:  # the lowest point of a parabola through three of them
            left, middle, right = variances[best - 1 : best + 2].tolist()
            part = 0.5 * (left - right) / (left - 2.0 * middle + right)
            lag, least = lag + part * float(self._lags[1]), max(middle - 0.25 * part * (left - right), 0.0)
        return lag, math.sqrt(least)

    def _truth_at(self, places: FloatArray, times: FloatArray) -> FloatArray:
        """Return the true heights at places (N, 2) [m] at ``times`` (K,) [s], which it reaches: (K, N) [m]; NaN =
        unknown."""
        stamps = np.array([stamp for stamp, _ in self._truth])
        before = np.maximum(np.searchsorted(stamps, times, side="right") - 1, 0)
        after = np.minimum(before + 1, len(stamps) - 1)
        first = int(before.min())
        heights = np.stack([it.at(places, 0.0).heights for _, it in self._truth[first : int(after.max()) + 1]])
        gaps = np.maximum(stamps[after] - stamps[before], 1e-9)
        part = np.clip((times - stamps[before]) / gaps, 0.0, 1.0)[:, None]
        return np.asarray((1.0 - part) * heights[before - first] + part * heights[after - first])


def _cells(heights: HeightMap) -> tuple[FloatArray, FloatArray]:
    """Return the places (N, 2) [m] of the samples with ground, and their heights (N,) [m]."""
    grid = heights.geometry
    ground = ~np.isnan(heights.heights)
    return grid.to_world(*np.nonzero(ground)), heights.heights[ground].astype(np.float64) + grid.origin[2]
