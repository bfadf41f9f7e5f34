"""Running times of the stages of the pipeline."""

from collections import deque
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple, Self

import numpy as np

from smartmesh_ros.errors import require

# Stages in pipeline order. "total": a whole step without ingest and publish.
STAGES = ("ingest", "search", "collect", "step", "publish", "total")
# Number of runs of a stage that a window keeps. New runs replace the oldest.
WINDOW = 4096


class StageTimes(NamedTuple):
    """Running times of one stage in a window: number of runs, median, 99th percentile and maximum [us]."""

    stage: str
    runs: int
    p50_us: float
    p99_us: float
    max_us: float


class _Stage:
    """Context manager that adds the time spent in its block to the stage's current run, and the newest runs [s]."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.runs = 0
        self.times = deque[float](maxlen=WINDOW)
        self.pending = 0.0
        self.ran = False
        self._start = 0.0
        self._now = now

    def __enter__(self) -> None:
        self._start = self._now()

    def __exit__(self, *_: object) -> None:
        self.pending += self._now() - self._start
        self.ran = True

    def note(self, seconds: float) -> None:
        self.times.append(seconds)
        self.runs += 1


class Stopwatch:
    """Collects running times by stage.

    A stage may be entered several times in one run (once per batch of bodies). `lap` ends the run. ``now``: the clock
    [s].
    """

    def __init__(self, stages: tuple[str, ...] = STAGES, now: Callable[[], float] = perf_counter) -> None:
        self._stages = {stage: _Stage(now) for stage in stages}

    @classmethod
    def of(cls, given: Self | None) -> Self:
        """Return a stopwatch, a new one for None. Raises `InputError` if it is none."""
        it = cls() if given is None else given
        require(isinstance(it, cls), "parameter", "the stopwatch", it, "Stopwatch(...), or None for a new one")
        return it

    def stage(self, name: str) -> _Stage:
        """Return the timer of a stage: ``with stopwatch.stage("search"):`` times the block."""
        return self._stages[name]

    def note(self, name: str, seconds: float) -> None:
        """Add one run of a stage, timed by the caller [s]."""
        self._stages[name].note(seconds)

    def lap(self) -> None:
        """End the run of every stage that was entered since the last lap."""
        for stage in self._stages.values():
            if stage.ran:
                stage.note(stage.pending)
                stage.pending = 0.0
                stage.ran = False

    def read(self) -> list[StageTimes]:
        """Return the times since the last call, one entry per stage in pipeline order."""
        result = []
        for name, stage in self._stages.items():
            times = np.array(stage.times) * 1e6
            median, high, most = np.percentile(times, (50, 99, 100)) if stage.runs else (0.0, 0.0, 0.0)
            result.append(StageTimes(name, stage.runs, float(median), float(high), float(most)))
            stage.times.clear()
            stage.runs = 0
        return result
