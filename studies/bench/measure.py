"""Measures cases over many frames: median and spread (the report's Chapter 4)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import numpy as np

# Frames for warming up, which are not counted. If the first takes longer than a second, only one.
WARM_UP = 2
# A frame that would take longer than this is not measured [s].
LONGEST_FRAME = 2.5
# What goes on to the next frame.
Before = Callable[[], object] | None


@dataclass(frozen=True)
class Case:
    """A measured case: ``side`` x ``side`` samples or vertices, ``bodies`` at a time, colliders of ``rings``; zero =
    does not apply."""

    what: str
    method: str
    side: int = 0
    bodies: int = 1
    rings: int = 0


class Timing(NamedTuple):
    """Running time of a frame [us]: median, 10th and 90th percentile, and how many frames were measured."""

    median: float
    low: float
    high: float
    frames: int


@dataclass(frozen=True, kw_only=True)
class Effort:
    """``frames``: number of frames for each case. If they take longer than ``seconds``, fewer are measured, at least
    ``least``."""

    frames: int = 100
    least: int = 5
    seconds: float = 10.0
    quick: bool = False

    def of(self, values: Sequence[int]) -> Sequence[int]:
        """All sizes or numbers, or the first two of them in a quick run."""
        return values[:2] if self.quick else values


FULL = Effort()
QUICK = Effort(frames=8, least=2, seconds=0.1, quick=True)


class Bench:
    """Runs cases. Stores their ``timings``, and reasons by what was ``left_out``."""

    def __init__(self, effort: Effort = FULL) -> None:
        self.effort = effort
        self.timings: dict[Case, Timing] = {}
        self.left_out: dict[str, str] = {}

    def us(self, what: str, method: str, *, side: int = 0, bodies: int = 1, rings: int = 0) -> float:
        """Median of a case [us]; NaN where it was not measured."""
        timing = self.timings.get(Case(what, method, side, bodies, rings))
        return timing.median if timing else math.nan

    def time(self, case: Case, run: Callable[[], object], prepare: Before = None) -> Timing:
        """Measure ``run``. ``prepare`` runs before each call and is not measured."""
        effort, start = self.effort, perf_counter()
        for _ in range(WARM_UP):
            if perf_counter() - start < 1.0:
                self._lap(run, prepare)
        laps, start = list[float](), perf_counter()
        while len(laps) < effort.frames and (len(laps) < effort.least or perf_counter() - start < effort.seconds):
            laps.append(self._lap(run, prepare))
        low, median, high = np.percentile(np.array(laps) * 1e6, (10, 50, 90)).tolist()
        timing = self.timings[case] = Timing(median, low, high, len(laps))
        return timing

    @staticmethod
    def _lap(run: Callable[[], object], prepare: Before) -> float:
        if prepare is not None:
            prepare()
        start = perf_counter()
        run()
        return perf_counter() - start
