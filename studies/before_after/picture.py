"""The comparison as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from studies.before_after.contest import Compared


def draw(path: Path, compared: Sequence[Compared]) -> None:
    """Draw the speed-up of the update, a bar a case, with the targets."""
    ran = [one for one in compared if math.isfinite(one.speed_up)]
    figure = Figure(figsize=(9.0, 1.2 + 0.24 * len(ran)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    places = range(len(ran))
    colours = ["#0b6e4f" if one.case.kind == "auto" else "#7bc8a4" for one in ran]
    # Bars from 1 on, to the left where it is slower.
    axes.barh(places, [one.speed_up - 1.0 for one in ran], left=1.0, color=colours, height=0.7)
    for place, one in enumerate(ran):
        if one.case.to_reach is not None:
            axes.plot([one.case.to_reach] * 2, [place - 0.45, place + 0.45], color="#c1666b", linewidth=2.0)
        axes.annotate(
            f"{one.speed_up:.2f}", (max(one.speed_up, 1.0), place), xytext=(4, 0), textcoords="offset points",
            va="center", fontsize=7,
        )  # fmt: skip
    axes.axvline(1.0, color="0.3", linewidth=0.8)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}" if f"{value:.0e}"[0] in "25" else ""))
    axes.tick_params(axis="x", which="both", labelsize=8)
    axes.margins(x=0.1)
    axes.set_yticks(places, [one.case.title for one in ran], fontsize=8)
    axes.invert_yaxis()
    axes.set_title("Update: times faster than before (red: to reach)", fontsize=10)
    figure.savefig(path, dpi=90)
