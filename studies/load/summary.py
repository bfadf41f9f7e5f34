"""Figures of a run of a case."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.load.cases import Case

UPDATE = ("search", "collect", "collider", "bodies")


@dataclass(frozen=True)
class Summary:
    """One run.

    Stage times [ms]: median over windows of a second of the window's median and 99th percentile, and the maximum over
    all windows; NaN for a stage that did not run. Times a step: number of runs times the window's median, summed and
    divided by the number of steps, because not every stage runs in every step. ``latency`` [ms]: median, 99th
    percentile and maximum, None if no marker was received.
    """

    case: Case
    result: dict[str, Any]

    @classmethod
    def of(cls, result: dict[str, Any]) -> Summary:
        """From what `processes.run_case` returned."""
        return cls(Case(**result["case"]), result)

    def stage(self, name: str) -> tuple[float, float, float]:
        """Median, 99th percentile, maximum of a stage [ms]; the maximum is that of all windows."""
        times = np.array([w["stages"][name][1:] for w in self.result["windows"] if w["stages"][name][0]])
        if not len(times):
            return math.nan, math.nan, math.nan
        median, high = np.median(times[:, :2], axis=0) / 1e3
        return float(median), float(high), float(times[:, 2].max() / 1e3)

    def a_step(self, *names: str) -> float:
        """Time of stages a step [ms]."""
        windows = [w["stages"] for w in self.result["windows"]]
        steps = sum(w["step"][0] for w in windows) or math.nan
        return float(sum(w[name][0] * w[name][1] for w in windows for name in names) / steps / 1e3)

    @property
    def update_and_step(self) -> float:
        """Time of everything that is physics, a step [ms]."""
        return self.a_step(*UPDATE, "step")

    @property
    def steps_per_second(self) -> float:
        """Physics steps that were run."""
        windows = self.result["windows"]
        return float(sum(w["stages"]["step"][0] for w in windows) / self.seconds)

    @property
    def seconds(self) -> float:
        """Time that the windows cover [s]; a starved node may not have sent any."""
        return float(sum(w["seconds"] for w in self.result["windows"])) or math.nan

    @property
    def cpu_per_step(self) -> float:
        """Processor time of the node for each step, all in [ms]."""
        return float(1e3 * self.result["cpus"]["node"] / (self.steps_per_second or math.nan))

    @property
    def missed(self) -> float:
        """Share of the deadlines that were missed."""
        windows = self.result["windows"]
        return float(sum(w["misses"] for w in windows) / (self.case.physics_rate * self.seconds))

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second."""
        factors = [w["real_time_factor"] for w in self.result["windows"]]
        return float(np.mean(factors)) if factors else math.nan

    @property
    def latency(self) -> tuple[float, float, float] | None:
        """From sending to the marker [ms]."""
        times = self.result["latencies_ms"]
        if not times:
            return None
        median, high, most = np.percentile(times, (50, 99, 100)).tolist()
        return median, high, most

    @property
    def lost(self) -> int:
        """Maps and regions that the node never took."""
        return max(int(self.result["sent"]) - int(self.result["taken"]), 0)

    @property
    def memory(self) -> dict[str, float]:
        """Memory of the node [MiB]: resident, its part shared with DDS, and the peak."""
        found: dict[str, float] = self.result["memory_mib"]["node"]
        return found
