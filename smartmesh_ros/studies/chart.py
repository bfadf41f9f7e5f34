"""Pictures of cost against penetration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from smartmesh_ros.studies.configurations import Configuration, Family
from smartmesh_ros.studies.contest import Result
from smartmesh_ros.studies.front import error_of, pareto_front
from smartmesh_ros.studies.scene import Scene

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
    figure = Figure(figsize=(10.5, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _plot(axes, results, known, labels=True)
    axes.set_title(f"{scene.title} ({scene.bodies.count} bodies)")
    axes.set_xlabel("cost: update and step, per body and simulated second [ms]")
    axes.set_ylabel("penetration, 99 % [mm]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    figure.savefig(path, dpi=90)


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
    finite = [error_of(result) for result in results.values() if math.isfinite(error_of(result))]
    top = 1e3 * 3.0 * max([*finite, 1e-2])
    for family in COLOURS:
        mine = {name: result for name, result in results.items() if known[name].family == family and result.cost > 0.0}
        kept = [result for result in mine.values() if math.isfinite(error_of(result))]
        axes.scatter(
            [result.cost / 1e3 for result in kept],
            [1e3 * error_of(result) for result in kept],
            c=COLOURS[family], marker=MARKERS[family], s=46 if labels else 22, label=family, zorder=3,
            edgecolors="white", linewidths=0.5,
        )  # fmt: skip
        lost = [result for result in mine.values() if result.lost]
        axes.scatter([result.cost / 1e3 for result in lost], [top] * len(lost), c=COLOURS[family], marker="x", zorder=3)
        if labels:
            for name, result in mine.items():
                height = top if result.lost else 1e3 * error_of(result)
                text = f"{name} ({result.lost} lost)" if result.lost else name
                axes.annotate(
                    text, (result.cost / 1e3, height), xytext=(4, 3), textcoords="offset points", fontsize=7,
                    color=COLOURS[family], rotation=20 if result.lost else 0,
                )  # fmt: skip
    front = [results[name] for name in pareto_front(results)]
    axes.step(
        [result.cost / 1e3 for result in front], [1e3 * error_of(result) for result in front],
        where="post", color="0.35", linewidth=1.0, linestyle="--", label="Pareto front", zorder=2,
    )  # fmt: skip
    axes.grid(visible=True, which="major", alpha=0.3)
