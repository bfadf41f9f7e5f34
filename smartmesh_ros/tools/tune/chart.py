"""Cost against penetration, as a picture."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.tools.tune.report import NAMES
from smartmesh_ros.tools.tune.search import Search

# Colours of settings that exceed a limit which the axes do not show.
UNSEEN = {"failed": "tab:brown", "hover": "tab:purple", "deviation": "tab:pink", "longest": "tab:olive"}


def draw(path: Path, search: Search, verdict: Verdict) -> Any:
    """Write the chart to a file; return its axes."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots()
    _draw_search(axes, search)
    for line, value in ((axes.axvline, verdict.limits.cost), (axes.axhline, 1e3 * verdict.limits.penetration)):
        if math.isfinite(value):
            line(value, color="tab:red", linewidth=0.8, linestyle=":")
    for name, figures in verdict.others.items():
        _draw(axes, [figures], "s", color="tab:green", markersize=5)
        place = (figures.cost, 1e3 * figures.error)
        if math.isfinite(figures.error):
            axes.annotate(name, place, (5, 4), textcoords="offset points", fontsize=7, color="tab:green")
    chosen = verdict.chosen.figures
    _draw(axes, [verdict.defaults], "D", label="defaults, confirmed", color="tab:orange", markersize=9)
    _draw(axes, [verdict.short, chosen], "-", color="tab:red", linewidth=0.8)
    _draw(axes, [verdict.short], "x", label="chosen, in the search", color="tab:red", markersize=9)
    _draw(axes, [chosen], "X", label="chosen, confirmed", color="tab:red", markersize=9)
    axes.set(
        xscale="log", yscale="log", xlabel="cost [processor time per simulated second]",
        ylabel="penetration, 99 % [mm]", title=search.case.title,
    )  # fmt: skip
    axes.margins(0.12)
    axes.tick_params(axis="x", which="minor", labelsize=7)
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    return axes


def _draw_search(axes: Any, search: Search) -> None:
    """Draw the tried settings by the limit that they exceed, and their front."""
    groups: dict[str, list[Figures]] = {}
    for point in search.points():
        exceeded = next(iter(search.limits.excess(point.figures)), "")
        groups.setdefault(exceeded if exceeded in UNSEEN else "", []).append(point.figures)
    _draw(axes, groups.pop("", []), "o", label="tried", color="0.75", markersize=4)
    for name, tried in groups.items():
        _draw(axes, tried, "x", label=f"exceeds the limit of {NAMES[name]}", color=UNSEEN[name], markersize=4)
    front = [point.figures for point in search.front()]
    _draw(axes, front, "o-", label="front of the search", color="tab:blue", markersize=4, linewidth=1.0)


def _draw(axes: Any, figures: list[Figures], style: str, **look: Any) -> None:
    """Draw figures that were measured."""
    shown = [one for one in figures if math.isfinite(one.error)]
    if shown:
        axes.plot([one.cost for one in shown], [1e3 * one.error for one in shown], style, **look)
