"""The figures of runs, and the tables and pictures of docs/performance.md."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from studies.load.cases import Case
from studies.markdown import table

UPDATE = ("search", "collect")


@dataclass(frozen=True)
class Summary:
    """One run.

    Stage times [ms]: median over windows of a second of the window's median and 99th percentile, and the maximum over
    all windows; NaN for a stage that did not run. Times a step: number of runs times the window's median, summed and
    divided by the number of steps, because not every stage runs in every step. ``latency`` [ms]: median, 99th
    percentile and maximum, None if no marker was received.
    """

    result: dict[str, Any]  # of `driver.run_case`

    @cached_property
    def case(self) -> Case:
        """What was run."""
        return Case(**self.result["case"])

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


# The page of the load study and the soak, and the folder of its pictures and what they show.
PAGE, PICTURES = Path("docs/performance.md"), Path("docs/images/load")


def runs(summaries: list[Summary]) -> str:
    """All runs of one group."""
    head = [
        "bodies", "map", "input", "physics [Hz]", "whole step 50 / 99 % [ms]", "update a step [ms]",
        "`stepSimulation` [ms]", "markers [ms]", "ingest [ms]", "real-time factor", "late 50 / 99 / 100 % [ms]",
        "missed", "in to out 50 / 99 / 100 % [ms]", "lost", "CPUs", "memory [MiB]",
    ]  # fmt: skip
    return table(head, [_run(summary) for summary in summaries])


def memory(summaries: list[Summary]) -> str:
    """Memory against the map's size."""
    head = ["map", "input", "map's bytes [MiB]", "resident [MiB]", "of that shared with DDS", "peak [MiB]"]  # fmt: skip
    rows = []
    for s in summaries:
        size = 4.0 * s.case.side**2 / 2**20
        m = s.memory
        rows.append([f"{s.case.side}^2", s.case.mode, f"{size:.1f}", f"{m['resident']:.0f}", f"{m['shared']:.0f}",
                     f"{m['peak']:.0f}"])  # fmt: skip
    return table(head, rows)


def _run(s: Summary) -> list[str]:
    return [
        str(s.case.bodies), f"{s.case.side}^2", f"{s.case.mode} at {s.case.map_rate:g} Hz", f"{s.case.physics_rate:g}",
        " / ".join(map(_ms, s.stage("total")[:2])), _ms(s.a_step(*UPDATE)), _ms(s.stage("step")[0]),
        _ms(s.stage("publish")[0]), _ms(s.stage("ingest")[0]), f"{s.real_time_factor:.2f}",
        _three(s.stage("lateness")), f"{100 * s.missed:.2f} %", _three(s.latency), _lost(s),
        f"{s.result['cpus']['node']:.2f}", f"{s.memory['resident']:.0f}",
    ]  # fmt: skip


def _lost(s: Summary) -> str:
    return f"{s.lost} of {s.result['sent']}"


def _ms(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _three(values: tuple[float, float, float] | None) -> str:
    return " / ".join(_ms(value) for value in values) if values else "-"


STAGES = {"search": "#9ecae1", "collect": "#4292c6", "step": "#d95f0e", "publish": "#74c476"}


def draw(summaries: list[Summary], machine: str, folder: Path) -> None:
    """Draw the pictures of the runs of the grid."""
    for name, draw_into in (("bodies", _bodies), ("latency", _latency)):
        figure = Figure(layout="constrained")
        draw_into(figure, summaries)
        figure.text(0.995, 0.002, machine, fontsize=6, ha="right", va="bottom", color="grey")
        figure.savefig(folder / f"{name}.png", dpi=110)


def _bodies(figure: Figure, summaries: list[Summary]) -> None:
    """Where a step's time goes, by the number of bodies."""
    figure.set_size_inches(11, 4.2)
    axes = figure.subplots(1, 2)
    for axis, rate in zip(axes, (240.0, 60.0), strict=True):
        runs = sorted(
            (s for s in summaries if s.case.physics_rate == rate and s.case.side == 1024 and s.case.mode == "regions"
             and s.case.map_rate == 60.0), key=lambda s: s.case.bodies)  # fmt: skip
        bottom = np.zeros(len(runs))
        for stage, colour in STAGES.items():
            times = np.nan_to_num([s.a_step(stage) for s in runs])
            axis.bar(range(len(runs)), times, bottom=bottom, color=colour, label=stage, width=0.6)
            bottom += times
        axis.axhline(1e3 / rate, color="black", linestyle="--", linewidth=1, label="time there is")
        axis.plot(range(len(runs)), [s.cpu_per_step for s in runs], "kx", label="processor time a step, all in")
        axis.set_xticks(range(len(runs)), [str(s.case.bodies) for s in runs])
        axis.set_xlabel("bodies")
        axis.set_ylabel("time a step [ms]")
        axis.set_title(f"{rate:g} Hz physics, regions of a 1024$^2$ map at 60 Hz")
    axes[0].legend(fontsize=8)


def _latency(figure: Figure, summaries: list[Summary]) -> None:
    """From a region that is sent to the marker that shows it."""
    figure.set_size_inches(10, 4.5)
    axis = figure.subplots()
    axis.set_prop_cycle(color=[*mpl.colormaps["tab10"](range(10)), "black", "gold"])  # twelve, one for each line
    for s in sorted(summaries, key=lambda s: (s.case.bodies, -s.case.physics_rate)):
        if s.case.side != 1024 or not s.result["latencies_ms"] or s.case.map_rate not in (30.0, 60.0):
            continue
        times = np.sort(s.result["latencies_ms"])
        share = np.arange(1, len(times) + 1) / len(times)
        style = "--" if s.case.mode == "full" else "-"
        bodies = "1 body" if s.case.bodies == 1 else f"{s.case.bodies} bodies"
        label = f"{bodies}, {s.case.mode} at {s.case.map_rate:g} Hz, physics {s.case.physics_rate:g} Hz"
        axis.plot(times, share, style, linewidth=1.2, label=label)
    axis.set_xscale("log")
    ticks = [2, 5, 10, 20, 50, 100]
    axis.set_xticks(ticks, [str(tick) for tick in ticks])
    axis.minorticks_off()
    axis.set_xlabel("from the map that is sent to the marker that shows it [ms]")
    axis.set_ylabel("share of the maps")
    axis.set_title("Latency through the node, 1024$^2$ map")
    figure.legend(loc="outside right upper", fontsize=7, frameon=False)
    axis.grid(alpha=0.3)
