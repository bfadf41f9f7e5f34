"""The pictures of the load study."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from studies.load.tables import Summary

STAGES = {
    "search": "#9ecae1", "collect": "#4292c6", "collider": "#084594", "bodies": "#807dba", "step": "#d95f0e",
    "publish": "#74c476",
}  # fmt: skip


def draw(groups: dict[str, list[Summary]], machine: str, folder: Path) -> list[Path]:
    """Draws every picture there are runs for."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    if groups["grid"]:
        paths += [_bodies(groups["grid"], machine, folder / "bodies.png")]
        paths += [_latency(groups["grid"], machine, folder / "latency.png")]
    if groups["executors"]:
        paths += [_executors(groups["executors"], machine, folder / "executors.png")]
    return paths


def _bodies(summaries: list[Summary], machine: str, path: Path) -> Path:
    """Where a step's time goes, by the number of bodies."""
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
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
    return _save(figure, machine, path)


def _executors(summaries: list[Summary], machine: str, path: Path) -> Path:
    """Lateness, real-time factor and processor time of the ways to run the loop."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
    place = np.arange(len(summaries))
    late = np.array([s.stage("lateness") for s in summaries]) + 1e-3
    axes[0].bar(place, late[:, 1], color="#084594")
    axes[0].plot(place, late[:, 2], "k_", markersize=14, label="maximum")
    axes[0].set_yscale("log")
    axes[0].set_ylabel("start of a step after its deadline, 99 % [ms]")
    axes[0].legend(fontsize=8)
    axes[1].bar(place, [s.real_time_factor for s in summaries], color="#084594")
    axes[1].axhline(1.0, color="black", linestyle="--", linewidth=1)
    axes[1].set_ylabel("real-time factor")
    axes[2].bar(place, [s.cpu_per_step for s in summaries], color="#084594")
    axes[2].set_ylabel("processor time a step, all in [ms]")
    for axis in axes:
        axis.set_xticks(
            place, [s.case.executor for s in summaries], fontsize=7, rotation=30, ha="right", rotation_mode="anchor"
        )
    figure.suptitle("Ways to run the loop: 100 bodies, full 1024$^2$ maps at 30 Hz")
    return _save(figure, machine, path)


def _latency(summaries: list[Summary], machine: str, path: Path) -> Path:
    """From a region that is sent to the marker that shows it."""
    figure, axis = plt.subplots(figsize=(10, 4.5), layout="constrained")
    axis.set_prop_cycle(color=[*plt.get_cmap("tab10").colors, "black", "gold"])  # twelve, one for each line
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
    return _save(figure, machine, path)


def _save(figure: plt.Figure, machine: str, path: Path) -> Path:
    figure.text(0.995, 0.002, machine, fontsize=6, ha="right", va="bottom", color="grey")
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path
