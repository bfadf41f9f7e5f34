"""``make records``: terrain tax, touchdown and size of cells, beside other engines; fills docs/records.md."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from studies.chart import PLAIN
from studies.pages import ROOT, fill, measured_on, save, say
from studies.records.cells import cells_table
from studies.records.entrants import ENTRANTS, OURS
from studies.records.tax import engine_table, world_table
from studies.records.touchdown import touchdown_table

PAGE, RESULTS, PICTURE = (ROOT / "docs" / name for name in ("records.md", "records.json", "images/records.png"))


def main() -> None:
    """Measure, print the tables, write JSON and the page, and draw the picture."""
    results: dict[str, tuple[str, Any]] = {}
    names = ("touchdown", "cells", "tax of engines", "tax")
    for name, run in zip(names, (touchdown_table, cells_table, engine_table, world_table), strict=True):
        say(name)
        results[name] = run()
        print(f"\n{results[name][0]}")
    save(RESULTS, {"machine": measured_on(), **{name: found for name, (_, found) in results.items()}})
    fill(PAGE, {name: f"{text}\n\n{measured_on()}." for name, (text, _) in results.items()})
    draw(PICTURE, *(results[name][1] for name in ("tax of engines", "touchdown", "cells")))


TAXED = ("1 ball", "1 box", "100 balls", "100 boxes")
BOUNCE = "0.6"


def draw(path: Path, tax: Mapping[str, Any], touchdown: Mapping[str, Any], cells: Mapping[str, Any]) -> None:
    """Draw tax by crowd, rebound by phase, and force by size of cells, a line or bar for each engine."""
    figure = Figure(figsize=(13.0, 3.8), layout="constrained", dpi=90)
    left, middle, right = figure.subplots(1, 3)
    names = list(touchdown)
    for index, name in enumerate(names):
        colour, width = ENTRANTS[name][2], 2.4 if name == OURS else 1.4
        bars = [float(np.median(tax[crowd][name]["still"])) for crowd in TAXED]
        left.bar(np.arange(len(TAXED)) + 0.16 * (index - 0.5 * (len(names) - 1)), bars, 0.15, color=colour, label=name)
        angles = np.arange(len(touchdown[name][BOUNCE])) * 360.0 / len(touchdown[name][BOUNCE])
        middle.plot(angles, touchdown[name][BOUNCE], "o-", color=colour, linewidth=width, markersize=4)
        sizes = [cell for cell in cells["boxes"][name] if "seam" not in cell]
        forces = [max(cells[kind][name][cell].force for kind in cells) for cell in sizes]
        right.plot([float(cell.removesuffix(" cm")) for cell in sizes], forces, "o-", color=colour, linewidth=width)
    left.set_xticks(range(len(TAXED)), TAXED)
    left.set_yscale("log")
    left.axhline(1.0, color="0.3", linewidth=0.8)
    left.set_title("Terrain tax: a step on a field over one on a plane", fontsize=10)
    middle.axhline(float(BOUNCE), color="0.3", linewidth=0.8, linestyle="--")
    middle.set_xlabel("phase of the heaving deck at touchdown [deg]")
    middle.set_title(f"Touchdown: rebound of a ball, e = {BOUNCE}", fontsize=10)
    right.set(xscale="log", yscale="log", xlabel="size of the cells [cm]")
    for axis, values in ((left.yaxis, (1, 2, 3, 5)), (right.xaxis, (2.5, 5, 10, 20))):  # which alone are named
        axis.set_major_locator(FixedLocator(values))
        axis.set_major_formatter(PLAIN)
        axis.set_minor_locator(NullLocator())
    right.set_title("Force off on one slope, rms [% of the weight]", fontsize=10)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=len(names), frameon=False)
    figure.savefig(path)
