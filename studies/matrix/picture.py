"""The matrix as a table and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from studies.markdown import table
from studies.matrix.row import Outcome

PASS, FAIL, NONE = "#cfe8d5", "#f4c7c3", "#eeeeee"


def figure_text(outcome: Outcome) -> str:
    """The figure of a cell, short."""
    value = outcome.figure
    if value is None:
        return "-"
    if not math.isfinite(value):
        return "fails"
    return f"{value:.0f}" if value == round(value) or abs(value) >= 99.5 else f"{value:.2g}"


def matrix_table(outcomes: Sequence[Outcome]) -> str:
    """The matrix in Markdown; figures beyond their limit are bold."""
    methods = list(dict.fromkeys(outcome.method for outcome in outcomes))
    cells = {(outcome.row, outcome.method): outcome for outcome in outcomes}
    rows = []
    for row in dict.fromkeys(outcome.row for outcome in outcomes):
        first = cells[row, methods[0]]
        found = [cells[row, method] for method in methods]
        texts = [f"**{figure_text(o)}**" if o.passed is False else figure_text(o) for o in found]
        rows.append([row, f"{first.limit:g} {first.unit}", first.source, *texts])
    passed = [sum(o.passed is True for o in outcomes if o.method == method) for method in methods]
    ran = [sum(o.passed is not None for o in outcomes if o.method == method) for method in methods]
    rows.append(["passed", "", "", *[f"{p} of {r}" for p, r in zip(passed, ran, strict=True)]])
    return table(["test", "limit", "source of the limit", *methods], rows)


def draw_matrix(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Green cells pass, red ones fail; each shows its figure."""
    methods = list(dict.fromkeys(outcome.method for outcome in outcomes))
    rows = list(dict.fromkeys(outcome.row for outcome in outcomes))
    figure = Figure(figsize=(3.6 + 1.15 * len(methods), 1.6 + 0.26 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for outcome in outcomes:
        x, y = methods.index(outcome.method), rows.index(outcome.row)
        colour = NONE if outcome.passed is None else PASS if outcome.passed else FAIL
        axes.add_patch(_cell(x, y, colour))
        weight = "bold" if outcome.passed is False else "normal"
        axes.text(x + 0.5, y + 0.5, figure_text(outcome), ha="center", va="center", fontsize=8, fontweight=weight)
    limits = {outcome.row: f"{outcome.row}  (<= {outcome.limit:g} {outcome.unit})" for outcome in outcomes}
    axes.set_xlim(0, len(methods))
    axes.set_ylim(len(rows), 0)
    axes.set_xticks([x + 0.5 for x in range(len(methods))], methods, rotation=25, ha="left", fontsize=8)
    axes.xaxis.tick_top()
    axes.set_yticks([y + 0.5 for y in range(len(rows))], [limits[row] for row in rows], fontsize=8)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title("Stability: green passes, red fails its limit; figures in the limit's unit", fontsize=10)
    figure.savefig(path, dpi=100)


def _cell(x: int, y: int, colour: str):  # type: ignore[no-untyped-def]
    from matplotlib.patches import Rectangle

    return Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", linewidth=1.5)
