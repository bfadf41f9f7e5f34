"""Cost against penetration, as a picture."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from smartmesh_ros.tools.tune.figures import Figures, front
from smartmesh_ros.tools.tune.report import Result


def draw(path: Path, result: Result) -> Any:
    """Write the chart to a file; return its axes."""
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes: Any = figure.subplots()
    _draw(axes, result.points, "o", label="tried", color="0.75", markersize=4)
    _draw(axes, front(result.points), "o-", label="front", color="tab:blue", markersize=4, linewidth=1.0)
    for line, value in ((axes.axvline, result.limits["cost"]), (axes.axhline, 1e3 * result.limits["penetration"])):
        if math.isfinite(value):
            line(value, color="tab:red", linewidth=0.8, linestyle=":")
    if result.given is not None:
        _draw(axes, [result.given], "s", label="as given", color="tab:green", markersize=5)
    _draw(axes, [result.defaults], "D", label="defaults", color="tab:orange", markersize=9)
    _draw(axes, [result.chosen], "X", label="chosen", color="tab:red", markersize=9)
    axes.set(
        xscale="log", yscale="log", xlabel="cost [processor time per simulated second]",
        ylabel="penetration, 99 % [mm]", title=result.case.title,
    )  # fmt: skip
    axes.margins(0.12)
    axes.tick_params(axis="x", which="minor", labelsize=7)
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    return axes


def _draw(axes: Any, figures: Iterable[Figures], style: str, **look: Any) -> None:
    """Draw figures that were measured."""
    shown = [one for one in figures if math.isfinite(one.error)]
    if shown:
        axes.plot([one.cost for one in shown], [1e3 * one.error for one in shown], style, **look)
