"""Measures frames of cases: median and spread (the report's Chapter 4)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from timeit import Timer

import numpy as np

# Frames for warming up, which are not counted. If the first takes longer than a second, only one.
WARM_UP = 2
# A frame that would take longer than this is not measured [s].
LONGEST_FRAME = 2.5
# What goes on to the next frame.
Before = Callable[[], object] | None
# What is measured, by which method, and its size: samples or vertices on a side of the main mesh, or rings of the
# collider.
Case = tuple[str, str, int]


@dataclass
class Bench:
    """Runs cases; stores what was ``found``: median, 10th and 90th percentile [us], and number of frames; and reasons
    by what was ``left_out``.

    ``frames``: number of frames for each case, at ``most``; if they take longer than ``seconds``, fewer, at ``least``.
    ``quick``: of all sizes the first two only.
    """

    most: int = 100
    least: int = 5
    seconds: float = 10.0
    quick: bool = False
    found: dict[Case, tuple[float, float, float, int]] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def some(self, sizes: Sequence[int]) -> Sequence[int]:
        """Return all sizes, or the first two of them in a quick run."""
        return sizes[:2] if self.quick else sizes

    def us(self, what: str, method: str, size: int) -> float:
        """Median of a case [us]; NaN where it was not measured."""
        return self.found.get((what, method, size), (math.nan,))[0]

    def time(self, case: Case, run: Callable[[], object], prepare: Before = None) -> None:
        """Measure ``run``. ``prepare`` runs before each call and is not measured."""
        start, timer = perf_counter(), Timer(run, prepare or "pass")
        for _ in range(WARM_UP):
            if perf_counter() - start < 1.0:
                timer.timeit(1)
        laps, start = list[float](), perf_counter()
        while len(laps) < self.most and (len(laps) < self.least or perf_counter() - start < self.seconds):
            laps.append(timer.timeit(1))
        median, low, high = 1e6 * np.percentile(laps, (50, 10, 90))
        self.found[case] = float(median), float(low), float(high), len(laps)
