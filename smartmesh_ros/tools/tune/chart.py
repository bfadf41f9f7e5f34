"""Cost against penetration, as a picture and in the terminal."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from smartmesh_ros.tools.tune.confirm import Verdict
from smartmesh_ros.tools.tune.figures import Figures
from smartmesh_ros.tools.tune.front import Point, front
from smartmesh_ros.tools.tune.words import broken_limit, verb

WIDTH, HEIGHT = 64, 16
# Marks of points by the limit that they exceed, "" = none. The axes show cost and penetration only.
SIGNS = {"": ".", "failed": "l", "hover": "h", "deviation": "d", "longest": "t", "penetration": ",", "cost": ","}
UNSEEN = {"failed": "tab:brown", "hover": "tab:purple", "deviation": "tab:pink", "longest": "tab:olive"}


class Mark(NamedTuple):
    """A point of the chart: share of a core, penetration [m], and a character."""

    cost: float
    error: float
    sign: str


def marks(points: Iterable[Point], best: Iterable[Point], verdict: Verdict) -> list[Mark]:
    """Return all marks, the most important last, because later marks cover earlier ones."""
    found = [
        Mark(point.figures.cost, point.figures.error, SIGNS[broken_limit(point.figures, verdict.searched)])
        for point in points
    ]
    found += [Mark(point.figures.cost, point.figures.error, "o") for point in best]
    found += [Mark(figures.cost, figures.error, "p") for figures in verdict.others.values()]
    found.append(Mark(verdict.defaults.cost, verdict.defaults.error, "D"))
    found.append(Mark(verdict.short.cost, verdict.short.error, "x"))
    found.append(Mark(verdict.chosen.figures.cost, verdict.chosen.figures.error, "X"))
    return [mark for mark in found if math.isfinite(mark.error) and mark.cost > 0.0]


def in_terminal(points: Sequence[Point], verdict: Verdict) -> str:
    """Return the chart as text, with logarithmic axes."""
    shown = marks(points, front(points, verdict.searched), verdict)
    left, right = _ends([mark.cost for mark in shown])
    low, high = _ends([mark.error for mark in shown])
    cells = [[" "] * WIDTH for _ in range(HEIGHT)]
    for mark in shown:
        column = round((WIDTH - 1) * (math.log(mark.cost) - left) / (right - left))
        line = round((HEIGHT - 1) * (high - math.log(mark.error)) / (high - low))
        cells[line][column] = mark.sign
    labels = {0: f"{1e3 * math.exp(high):9.3g}", HEIGHT - 1: f"{1e3 * math.exp(low):9.3g}"}
    lines = [f"{labels.get(number, ''):>9} |{''.join(line)}" for number, line in enumerate(cells)]
    lines = ["penetration 99 % [mm]", *lines, f"{'':9} +{'-' * WIDTH}"]
    first, last = f"{math.exp(left):.3g}", f"{math.exp(right):.3g}"
    middle = "cost [share of a core]"
    lines.append(f"{'':11}{first}{middle:^{max(WIDTH - len(first) - len(last), len(middle))}}{last}")
    there = {mark.sign for mark in shown}
    dots = {SIGNS[""]: "others", SIGNS["cost"]: "break what is asked"}
    dots |= {SIGNS[name]: verb(name) for name in UNSEEN}
    legend = [
        "Confirming run: X chosen  D defaults  p presets",
        "Search: x chosen  o front  " + "  ".join(f"{sign} {words}" for sign, words in dots.items() if sign in there),
    ]
    return "\n".join([*lines, *legend])


def _ends(values: Sequence[float]) -> tuple[float, float]:
    """Return the logarithms of an axis' ends, at least a little apart."""
    low, high = math.log(min(values)), math.log(max(values))
    return (low, high) if high - low > 1e-3 else (low - 0.1, high + 0.1)


def draw(path: Path, title: str, points: Sequence[Point], verdict: Verdict) -> None:
    """Write the chart as a picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots()
    best = front(points, verdict.searched)
    groups: dict[str, list[Figures]] = defaultdict(list)
    for point in points:
        if math.isfinite(point.figures.error):
            groups[broken_limit(point.figures, verdict.searched)].append(point.figures)
    _dots(axes, "tried", [*groups[""], *groups["cost"], *groups["penetration"]], marker="o", color="0.75")
    for name, colour in UNSEEN.items():
        _dots(axes, f"tried, {verb(name)}", groups[name], marker="x", color=colour)
    for line, value in ((axes.axvline, verdict.limits.cost), (axes.axhline, 1e3 * verdict.limits.penetration)):
        if math.isfinite(value):
            line(value, color="tab:red", linewidth=0.8, linestyle=":")
    axes.plot(
        [point.figures.cost for point in best], [1e3 * point.figures.error for point in best],
        "o-", color="tab:blue", markersize=4, linewidth=1.0, label="front of the search",
    )  # fmt: skip
    for name, figures in verdict.others.items():
        if math.isfinite(figures.error):
            axes.plot(figures.cost, 1e3 * figures.error, "s", color="tab:green", markersize=5)
            axes.annotate(
                name, (figures.cost, 1e3 * figures.error), xytext=(5, 4), textcoords="offset points", fontsize=7,
                color="tab:green",
            )  # fmt: skip
    _point(axes, "defaults", verdict.defaults.cost, verdict.defaults.error, "D", "tab:orange")
    chosen, short = verdict.chosen.figures, verdict.short
    axes.plot([short.cost, chosen.cost], [1e3 * short.error, 1e3 * chosen.error], color="tab:red", linewidth=0.8)
    _point(axes, "chosen, in the search", short.cost, short.error, "x", "tab:red")
    _point(axes, "chosen, confirmed", chosen.cost, chosen.error, "X", "tab:red")
    axes.set(
        xscale="log", yscale="log", xlabel="cost [processor time per simulated second]",
        ylabel="penetration, 99 % [mm]", title=title,
    )  # fmt: skip
    axes.margins(0.12)
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def _dots(axes: Any, label: str, figures: Sequence[Figures], **look: Any) -> None:
    if figures:
        costs, errors = [one.cost for one in figures], [1e3 * one.error for one in figures]
        axes.scatter(costs, errors, s=14, linewidths=0.9, label=label, **look)


def _point(axes: Any, label: str, cost: float, error: float, marker: str, colour: str) -> None:
    if math.isfinite(error):
        axes.plot(cost, 1e3 * error, marker, color=colour, markersize=9, label=label, linestyle="none")
