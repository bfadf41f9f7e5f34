"""``make load``: the node under load, as real processes over DDS."""

import argparse
import math
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from smartmesh_ros import HeightMap
from smartmesh_ros.errors import counted
from smartmesh_ros.startup.dds import isolated_unless_chosen, use_large_message_profile
from studies.load.driver import Case, groups, run_case
from studies.pages import fill, save, short, table

SIDES = (256, 1024, 4096, 8192, 16384)
# Samples on one side of a region, and how many are taken.
REGION, COUNT, WARM_UP = 64, 1000, 20


def regions() -> tuple[str, dict[str, list[float]]]:
    """Return the table of times of regions on each map, ``still``: under a body that stays, ``anywhere``: at places all
    over the map, most of them for the first time; and their 10th, 50th, 90th and 99th percentiles by place and map
    [us]."""
    maps = {side: HeightMap(np.zeros((side, side), np.float32), resolution=0.1) for side in SIDES}
    rng = np.random.default_rng(0)
    rows, found = [], dict[str, list[float]]()
    for way in ("still", "anywhere"):
        times: dict[int, list[float]] = {side: [] for side in SIDES}
        for turn in range(WARM_UP + COUNT):
            heights = rng.normal(size=(REGION, REGION)).astype(np.float32)
            for side, heightmap in maps.items():
                row, column = (side // 3, side // 3) if way == "still" else rng.integers(0, side - REGION, 2).tolist()
                time = heightmap.time + 0.02
                start = perf_counter()
                heightmap.update_region(row, column, heights, time=time)
                if turn >= WARM_UP:
                    times[side].append(1e6 * (perf_counter() - start))
        for side in SIDES:
            shares = found[f"{way} on {side}^2"] = np.percentile(times[side], (10, 50, 90, 99)).tolist()
            low, median, high, highest = (f"{time:.1f}" for time in shares)
            rows.append([f"{side}^2", str(COUNT), way, median, f"{low} to {high}", highest])
            print(f"regions {way} on {side}^2: {median} us", flush=True)
    return table(["map", "regions", "place", "median [us]", "10 to 90 % [us]", "99 % [us]"], rows), found


def main(args: list[str] | None = None) -> None:
    """Runs the study; writes JSON and the blocks of what ran."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=[*groups(), "regions"], help="run one group again, keep the others")
    only = parser.parse_args(args).only
    blocks = {"machine": f"Machine: {short()}."}
    use_large_message_profile()
    with isolated_unless_chosen():
        for group, members in groups().items():
            if only not in (None, group):
                continue
            summaries = []
            for case in members:
                summaries.append(s := summary_of(run_case(case)))
                words = f"{100 * s.missed:.2f} % missed, real time {s.real_time_factor:.2f}, lost {s.lost}"
                print(f"{case}: {words}", flush=True)
                save(RESULTS, {"machine": short(), group: [s._asdict() | {"case": asdict(s.case)} for s in summaries]})
            blocks[group] = (memory if group == "memory" else runs)(summaries)
            if group == "grid":
                draw(summaries, short(), PICTURES)
    if only in (None, "regions"):
        blocks["regions"], found = regions()
        save(RESULTS, {"machine": short(), "regions": found})
    fill(PAGE, blocks)
    print(f"wrote {PAGE}")


# The page of the load study and the soak, its folder of pictures, and its figures.
PAGE, PICTURES = Path("docs/performance.md"), Path("docs/images/load")
RESULTS = PICTURES / "load.json"


class Summary(NamedTuple):
    """One run.

    ``stages`` [ms]: by name, median over windows of a second of the window's median and 99th percentile, and the
    maximum over all windows; NaN for a stage that did not run. ``a_step`` [ms]: time of a stage by its name, number of
    runs times the window's median, summed and divided by the number of steps, because not every stage runs in every
    step. ``cpu_per_step`` [ms]: processor time of the node. ``missed``: share of the deadlines. ``real_time_factor``:
    simulated seconds per second. ``latencies`` [ms]: from sending to the marker, sorted; none if no marker was
    received. ``sent``, ``lost``: maps and regions, and those that the node never took. ``cpus`` used by the node, and
    its ``memory`` [MiB].
    """

    case: Case
    stages: dict[str, list[float]]
    a_step: dict[str, float]
    cpu_per_step: float
    missed: float
    real_time_factor: float
    latencies: list[float]
    sent: int
    lost: int
    cpus: float
    memory: dict[str, float]


def summary_of(result: dict[str, Any]) -> Summary:
    """Return what `driver.run_case` found."""
    case, windows, cpus = result["case"], result["windows"], result["cpus"]
    told = [{s.stage: (s.count, s.p50_us, s.p99_us, s.max_us) for s in window.stages} for window in windows]
    # A starved node may not have sent any windows.
    seconds = float(sum(window.window_s for window in windows)) or math.nan
    steps = sum(one["step"][0] for one in told) or math.nan
    stages, a_step = {}, {}
    for name in ("search", "collect", "step", "publish", "ingest", "total", "lateness"):
        times = np.array([one[name] for one in told if one[name][0]]).reshape(-1, 4)
        a_step[name] = float(times[:, 0] @ times[:, 1] / steps / 1e3)
        columns = [*np.median(times[:, 1:3], axis=0), times[:, 3].max()] if len(times) else [math.nan] * 3
        stages[name] = [float(time) / 1e3 for time in columns]
    return Summary(
        case=case, stages=stages, a_step=a_step, cpu_per_step=1e3 * cpus * seconds / steps,
        missed=sum(window.deadline_misses for window in windows) / (case.physics_rate * seconds),
        real_time_factor=float(np.mean([window.real_time_factor for window in windows])) if windows else math.nan,
        latencies=sorted(1e3 * latency for latency in result["latencies"]), sent=result["sent"],
        lost=max(result["sent"] - result["taken"], 0), cpus=cpus, memory=result["memory"],
    )  # fmt: skip


def runs(summaries: list[Summary]) -> str:
    """All runs of one group."""
    head = [
        "bodies", "map", "input", "physics [Hz]", "whole step 50 / 99 % [ms]", "update a step [ms]",
        "`stepSimulation` [ms]", "markers [ms]", "ingest [ms]", "real-time factor", "late 50 / 99 / 100 % [ms]",
        "missed", "in to out 50 / 99 / 100 % [ms]", "lost", "CPUs", "memory [MiB]",
    ]  # fmt: skip
    rows = [
        [
            str(s.case.bodies), f"{s.case.side}^2", f"{s.case.mode} at {s.case.map_rate:g} Hz",
            f"{s.case.physics_rate:g}", _ms(s.stages["total"][:2]), _ms([s.a_step["search"] + s.a_step["collect"]]),
            *(_ms(s.stages[name][:1]) for name in ("step", "publish", "ingest")), f"{s.real_time_factor:.2f}",
            _ms(s.stages["lateness"]), f"{100 * s.missed:.2f} %",
            _ms(np.percentile(s.latencies, (50, 99, 100)).tolist()) if s.latencies else "-", f"{s.lost} of {s.sent}",
            f"{s.cpus:.2f}", f"{s.memory['resident']:.0f}",
        ]
        for s in summaries
    ]  # fmt: skip
    return table(head, rows)


def memory(summaries: list[Summary]) -> str:
    """Memory against the map's size."""
    head = ["map", "input", "map's bytes [MiB]", "resident [MiB]", "of that shared with DDS", "peak [MiB]"]
    rows = [
        [f"{s.case.side}^2", s.case.mode, f"{4.0 * s.case.side**2 / 2**20:.1f}",
         *(f"{s.memory[kind]:.0f}" for kind in ("resident", "shared", "peak"))]
        for s in summaries
    ]  # fmt: skip
    return table(head, rows)


def _ms(values: list[float]) -> str:
    return " / ".join(f"{value:.3g}" if math.isfinite(value) else "-" for value in values)


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
            times = np.nan_to_num([s.a_step[stage] for s in runs])
            axis.bar(range(len(runs)), times, bottom=bottom, color=colour, label=stage, width=0.6)
            bottom += times
        axis.axhline(1e3 / rate, color="black", linestyle="--", linewidth=1, label="time there is")
        axis.plot(range(len(runs)), [s.cpu_per_step for s in runs], "kx", label="processor time a step, all in")
        axis.set_xticks(range(len(runs)), [str(s.case.bodies) for s in runs])
        title = f"{rate:g} Hz physics, regions of a 1024$^2$ map at 60 Hz"
        axis.set(xlabel="bodies", ylabel="time a step [ms]", title=title)
    axes[0].legend(fontsize=8)


def _latency(figure: Figure, summaries: list[Summary]) -> None:
    """From a region that is sent to the marker that shows it."""
    figure.set_size_inches(10, 4.5)
    axis = figure.subplots()
    axis.set_prop_cycle(color=[*mpl.colormaps["tab10"](range(10)), "black", "gold"])  # twelve, one for each line
    for s in sorted(summaries, key=lambda s: (s.case.bodies, -s.case.physics_rate)):
        if s.case.side != 1024 or not s.latencies or s.case.map_rate not in (30.0, 60.0):
            continue
        style = "--" if s.case.mode == "full" else "-"
        label = f"{counted(s.case.bodies)}, {s.case.mode} at {s.case.map_rate:g} Hz, physics {s.case.physics_rate:g} Hz"
        axis.ecdf(s.latencies, linestyle=style, linewidth=1.2, label=label)
    axis.set_xscale("log")
    ticks = [2, 5, 10, 20, 50, 100]
    axis.set_xticks(ticks, [str(tick) for tick in ticks])
    axis.minorticks_off()
    axis.set(xlabel="from the map that is sent to the marker that shows it [ms]", ylabel="share of the maps",
             title="Latency through the node, 1024$^2$ map")  # fmt: skip
    figure.legend(loc="outside right upper", fontsize=7, frameon=False)
    axis.grid(alpha=0.3)
