"""The report's Figures 2 and 12 to 17 with today's figures beside."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from studies.bench import report
from studies.bench.measure import Results
from studies.bench.tables import SIMPLE, update_per_body
from studies.markdown import size

# One colour a method, everywhere; the report's figures are hollow or dashed, today's filled or drawn through.
ORANGE, BLUE, GREEN, RED, PURPLE, GREY, BROWN = (
    "#e08214", "#2b6cb0", "#2f855a", "#c53030", "#6b46c1", "#718096", "#8d6e4a",
)  # fmt: skip
MS = "running time [ms]"
TODAY = {"linestyle": "-", "marker": "o"}
REPORT = {"linestyle": "--", "marker": "o", "markerfacecolor": "white"}
# Searches through the code that serves whole batches, used for one body.
BATCH_CODE = {"linestyle": ":", "marker": "s"}


def draw_all(results: Results, folder: Path) -> list[Path]:
    """Draws every figure into ``folder``; returns the files."""
    figures = {2: figure_2, 12: figure_12, 13: figure_13, 14: figure_14, 15: figure_15, 16: figure_16, 17: figure_17}
    files = []
    for number, draw in figures.items():
        figure = Figure(figsize=(11.0, 5.2), layout="constrained")
        draw(figure.subplots(), results)
        files.append(folder / f"figure_{number:02d}.png")
        figure.savefig(files[-1], dpi=110)
    return files


def figure_2(axes: Any, results: Results) -> None:
    """Frames per second of the whole loop."""
    for method, name, colour in (("simple", "Simple-Mesh", ORANGE), ("smart", "Smart-Mesh", BLUE)):
        frames = _today(results, "frame", method, (25, 50, 100, 150, 200))
        _line(axes, {side: 1e3 / time for side, time in frames.items()}, colour, f"{name}, today")
    axes.axhline(60.0, color=GREY, linestyle=":", label="60 frames per second")
    axes.set(
        title="Figure 2: frames per second with one ball (vertices, collider and physics; no graphics)",
        xlabel="vertices on a side of the main mesh", ylabel="frames per second",
    )  # fmt: skip
    _finish(axes, "linear")


def figure_12(axes: Any, results: Results) -> None:
    """The collider of the whole mesh by its vertices."""
    sides = [*report.SIMPLE_PHYSX, *report.LARGER]
    _line(axes, _squared(report.SIMPLE_PHYSX), ORANGE, "PhysX (BVH rebuilt), report", REPORT)
    _line(axes, _squared(report.SIMPLE_BULLET), BLUE, "Bullet (BVH refitted), report", REPORT)
    colours = (ORANGE, BLUE, PURPLE, RED, BROWN, GREY, GREEN)
    for (method, name), colour in zip(SIMPLE.items(), colours, strict=True):
        _line(axes, _squared(_today(results, "simple", method, sides)), colour, f"{name}, today")
    axes.set(title="Figure 12: update of a collider of the whole main mesh", xlabel="vertices", ylabel=MS)
    _finish(axes, "log")


def figure_13(axes: Any, results: Results) -> None:
    """Simple-Mesh against Smart-Mesh in both engines."""
    sides = list(report.SMART_BULLET)
    bars = {
        "Simple-Mesh PhysX": (ORANGE, report.SIMPLE_PHYSX, ("simple", "physx")),
        "Simple-Mesh Bullet": (RED, report.SIMPLE_BULLET, ("simple", "bullet_trimesh")),
        "Smart-Mesh PhysX": (PURPLE, report.SMART_PHYSX, ("smart", "physx")),
        "Smart-Mesh Bullet": (BLUE, report.SMART_BULLET, ("smart", "trimesh")),
        "heightfield patch": (GREEN, {}, ("smart", "heightfield")),
    }
    _pairs(axes, results, [size(side) for side in sides], sides, bars, by="side")
    axes.set(title="Figure 13: Simple-Mesh and Smart-Mesh of 3x3, one body", xlabel="main mesh", ylabel=MS)
    _finish(axes, None)


def figure_14(axes: Any, results: Results) -> None:
    """Local colliders of varying and of constant size."""
    bars = {
        "varying": (ORANGE, report.LOCAL_VARYING, ("local", "varying")),
        "constant": (BLUE, report.LOCAL_CONSTANT, ("local", "constant")),
        "heightfield": (GREEN, {}, ("local", "heightfield")),
    }
    _pairs(axes, results, [size(2 * rings + 1) for rings in report.RINGS], list(report.RINGS), bars, by="rings")
    places = [index + 0.45 for index in range(len(report.RINGS))]
    batch = [update_per_body(results, rings) / 1e3 for rings in report.RINGS]
    axes.plot(places, batch, "D", color=GREEN, markeredgecolor="black", label="heightfield, one of 100")
    axes.set(title="Figure 14: update of one local collider, main mesh 200x200", xlabel="collider", ylabel=MS)
    _finish(axes, None)


def figure_15(axes: Any, results: Results) -> None:
    """Searches by the size of the main mesh."""
    styles = {
        "brute_force": (ORANGE, "brute force"),
        "ray_cast": (PURPLE, "ray cast"),
        "best_first": (BLUE, "best-first, average"),
        "best_first_worst": (RED, "best-first, worst"),
        "grid_traversal": (GREEN, "grid traversal"),
    }
    sides = [50, 100, 200, *report.LARGER]
    for method, (colour, name) in styles.items():
        reported = report.SEARCH[method]
        _line(axes, _squared(reported), colour, f"{name}, report", REPORT)
        if method != "grid_traversal":
            _line(axes, _squared(_today(results, "search", method, reported)), colour, f"{name}, today")
        if method in ("brute_force", "best_first", "best_first_worst"):
            on_map = _today(results, "search_map", method, sides)
            _line(axes, _squared(on_map), colour, f"{name}, today, height map", BATCH_CODE)
    _line(axes, _squared(_today(results, "search_map", "grid_traversal", sides)), GREEN, "grid traversal, today")
    batch = {side: results.ms("search_batch", "grid_traversal", side=side, bodies=100) / 1000 for side in sides}
    _line(axes, _squared(batch), "black", "grid traversal, one of 100, today")
    axes.set(title="Figure 15: nearest-vertex search of one body", xlabel="vertices of the main mesh", ylabel=MS)
    _finish(axes, "log")


def figure_16(axes: Any, results: Results) -> None:
    """Collecting by the size of the collider."""
    bars = {
        "queue BFS": (ORANGE, report.COLLECT["queue_bfs"], ("collect", "queue_bfs")),
        "union BFS": (BLUE, report.COLLECT["union_bfs"], ("collect", "union_bfs")),
        "cached": (GREEN, report.COLLECT["cached"], ("collect", "cached")),
    }
    _pairs(axes, results, [size(2 * rings + 1) for rings in report.RINGS], list(report.RINGS), bars, by="rings")
    axes.set(title="Figure 16: collecting the vertices of one local collider", xlabel="collider", ylabel=MS)
    _finish(axes, None)


def figure_17(axes: Any, results: Results) -> None:
    """Simple-Mesh, general and uniform Smart-Mesh."""
    for reported, (what, method), colour, name in (
        (report.FINAL_SIMPLE, ("simple", "physx"), ORANGE, "Simple-Mesh (PhysX)"),
        (report.FINAL_GENERAL, ("smart", "general"), RED, "general Smart-Mesh"),
        (report.FINAL_UNIFORM, ("smart", "heightfield"), BLUE, "uniform-grid Smart-Mesh"),
    ):
        _line(axes, _squared(reported), colour, f"{name}, report", REPORT)
        today = _today(results, what, method, [*reported, *report.LARGER])
        _line(axes, _squared(today), colour, f"{name}, today")
    batch = update_per_body(results, 1) / 1e3
    if not math.isnan(batch):
        axes.axhline(batch, color=GREEN, label="uniform grid, one of 100, today")
    axes.set(title="Figure 17: update for one body, collider of 3x3", xlabel="vertices of the main mesh", ylabel=MS)
    _finish(axes, "log")


def _today(results: Results, what: str, method: str, sides: Iterable[int]) -> dict[int, float]:
    """Return times [ms] by the vertices on a side."""
    return {side: results.ms(what, method, side=side) for side in sides}


def _squared(times: Mapping[int, float]) -> dict[int, float]:
    """Return times by all vertices from those by the vertices on a side."""
    return {side**2: time for side, time in times.items()}


def _line(axes: Any, points: Mapping[int, float], colour: str, label: str, style: dict[str, Any] = TODAY) -> None:
    """A curve, without the points that were not measured."""
    known = {x: y for x, y in points.items() if not math.isnan(y)}
    if known:
        axes.plot(list(known), list(known.values()), color=colour, label=label, markersize=5, linewidth=1.6, **style)


def _pairs(axes: Any, results: Results, names: list[str], keys: list[int], bars: dict[str, Any], by: str) -> None:
    """Groups of bars: for each series the report's (hollow) and today's (filled)."""
    series: list[tuple[str, str, list[float], bool]] = []
    for name, (colour, reported, (what, method)) in bars.items():
        if reported:
            series.append((f"{name}, report", colour, [reported[key] for key in keys], False))
        today = [results.ms(what, method, **({"side": 200} | {by: key})) for key in keys]
        series.append((f"{name}, today", colour, today, True))
    width = 0.86 / len(series)
    for place, (label, colour, values, today_s) in enumerate(series):
        x = [index + (place - (len(series) - 1) / 2) * width for index in range(len(keys))]
        fill = {"color": colour} if today_s else {"facecolor": "white", "edgecolor": colour, "hatch": "///"}
        axes.bar(x, values, 0.92 * width, label=label, linewidth=1.0, **fill)
    axes.set_xticks(range(len(keys)), names)
    axes.set_yscale("log")


def _finish(axes: Any, x_scale: str | None) -> None:
    """Log scales, grid and legend."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    if x_scale is not None:
        axes.set_xscale(x_scale)
    axes.grid(True, which="major", alpha=0.35)
    axes.set_axisbelow(True)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
