"""Pictures of cost against penetration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from smartmesh_ros.evaluation.scene import Scene
from studies.configurations import Configuration, Family
from studies.contest import Result
from studies.front import error_of, pareto_front

COLOURS: dict[Family, str] = {
    "ours": "#0b6e4f",
    "ours, less": "#7bc8a4",
    "report": "#c1666b",
    "whole map": "#8d6a9f",
    "MuJoCo": "#1f77b4",
    "PhysX": "#e08e0b",
}
MARKERS: dict[Family, str] = {
    "ours": "o", "ours, less": "o", "report": "s", "whole map": "D", "MuJoCo": "^", "PhysX": "v",
}  # fmt: skip


def draw_scene(path: Path, scene: Scene, results: Mapping[str, Result], known: Mapping[str, Configuration]) -> None:
    """One scene: every configuration a point, the Pareto front a line."""
    figure = Figure(figsize=(11.0, 6.5), dpi=90)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.075, 0.09, 0.76, 0.84))
    _plot(axes, results, known, labels=True)
    axes.set_title(f"{scene.title} ({scene.bodies.count} bodies)")
    axes.set_xlabel("cost: update and step, per body and simulated second [ms]")
    axes.set_ylabel("penetration, 99 % [mm]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    figure.savefig(path)


def draw_all(
    path: Path, scenes: Sequence[Scene], results: Mapping[str, Mapping[str, Result]], known: Mapping[str, Configuration]
) -> None:
    """All scenes as small charts on common axes."""
    columns = 4
    rows = math.ceil(len(scenes) / columns)
    figure = Figure(figsize=(4.0 * columns, 3.0 * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, scene in zip(grid.flat, scenes, strict=False):
        _plot(axes, results[scene.name], known, labels=False)
        axes.set_title(scene.title, fontsize=9, wrap=True)
    for axes in list(grid.flat)[len(scenes) :]:
        axes.set_visible(False)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    figure.supxlabel("cost: update and step, per body and simulated second [ms]")
    figure.supylabel("penetration, 99 % [mm]; crosses on top lost bodies")
    figure.savefig(path, dpi=80)


def _plot(axes: Any, results: Mapping[str, Result], known: Mapping[str, Configuration], *, labels: bool) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}" if f"{value:.0e}"[0] in "25" else ""))
        axis.set_tick_params(which="minor", labelsize=8)
    finite = [error_of(result) for result in results.values() if math.isfinite(error_of(result))]
    top = 1e3 * 3.0 * max([*finite, 1e-2])
    for family in COLOURS:
        mine = [result for name, result in results.items() if known[name].family == family and result.cost > 0.0]
        kept = [result for result in mine if math.isfinite(error_of(result))]
        lost = [result for result in mine if result.lost]
        axes.scatter(
            [result.cost / 1e3 for result in kept], [1e3 * error_of(result) for result in kept],
            c=COLOURS[family], marker=MARKERS[family], s=46 if labels else 22, label=family, zorder=3,
            edgecolors="white", linewidths=0.5,
        )  # fmt: skip
        axes.scatter([result.cost / 1e3 for result in lost], [top] * len(lost), c=COLOURS[family], marker="x", zorder=3)
    front = [results[name] for name in pareto_front(results)]
    axes.step(
        [result.cost / 1e3 for result in front], [1e3 * error_of(result) for result in front],
        where="post", color="0.35", linewidth=1.0, linestyle="--", label="Pareto front", zorder=2,
    )  # fmt: skip
    axes.grid(visible=True, which="major", alpha=0.3)
    if labels:
        axes.margins(x=0.12, y=0.1)
        axes.autoscale_view()
        _label(axes, results, known, top)


def _label(axes: Any, results: Mapping[str, Result], known: Mapping[str, Configuration], top: float) -> None:
    """Writes the names beside the points, each where it covers no other."""
    shown = [(name, result) for name, result in results.items() if result.cost > 0.0]
    spots = {
        name: axes.transData.transform((result.cost / 1e3, top if result.lost else 1e3 * error_of(result)))
        for name, result in shown
    }
    taken: list[tuple[float, float, float, float]] = []
    for name, result in shown:
        text = f"{name} ({result.lost} lost)" if result.lost else name
        x, y = spots[name]
        width = 5.0 * len(text)
        offsets = [(6.0, 10.0 * shift + 6.0) for shift in (0, -1, 1, -2, 2, -3, 3, -4, 4)]
        offsets += [(-width - 6.0, offset) for _, offset in offsets]
        free = [(dx, dy) for dx, dy in offsets if not _covers((x + dx, y + dy, width, 9.0), taken)]
        dx, dy = free[0] if free else offsets[0]
        taken.append((x + dx, y + dy, width, 9.0))
        axes.annotate(
            text, (x, y), xycoords="figure pixels", xytext=(x + dx, y + dy), textcoords="figure pixels", fontsize=7,
            color=COLOURS[known[name].family], va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": "0.8", "linewidth": 0.5} if abs(dy) > 12.0 else None,
        )  # fmt: skip


def _covers(box: tuple[float, float, float, float], taken: Sequence[tuple[float, float, float, float]]) -> bool:
    x, y, width, height = box
    return any(x < u + w and u < x + width and abs(y - v) < 0.5 * (height + h) for u, v, w, h in taken)
