"""The README's chart: one scene of the accuracy study, legible at the width of a page.

``python -m studies.readme_chart`` draws it from the figures of the last run, and ``make studies`` after each run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from studies.chart import COLOURS
from studies.configurations import Family
from studies.contest import Result
from studies.front import distance_of
from studies.results_file import read_results

SCENE = "waves_w04_maps_60"
TITLE = "48 balls on waves of 0.3 m, maps at 60 Hz"
# Each line: its family, the configurations of the study in it by what is written beside them, its name on the chart,
# and the shift of that name from the line's first point [points].
LINES: tuple[tuple[Family, dict[str, str], str, tuple[float, float]], ...] = (
    ("ours", {"defaults, 60 Hz": "60 Hz", "defaults, 120 Hz": "120 Hz", "defaults": "240 Hz",
              "defaults, 480 Hz": "480 Hz", "defaults, 960 Hz": "960 Hz"}, "smartmesh_ros", (-4.0, 12.0)),
    ("MuJoCo", {"MuJoCo tuned, 120 Hz": "120 Hz", "MuJoCo tuned, 240 Hz": "", "MuJoCo tuned, 480 Hz": "",
                "MuJoCo tuned, 960 Hz": "to 960 Hz", "MuJoCo tuned, 1920 Hz": "MuJoCo, 1920 Hz",
                "MuJoCo tuned, 7680 Hz": "MuJoCo, 7680 Hz"}, "MuJoCo", (-4.0, 14.0)),
    ("PhysX", {"PhysX, 240 Hz": "", "PhysX, 480 Hz": ""}, "PhysX", (10.0, -4.0)),
    ("Rapier", {f"Rapier stiff, {rate} Hz": "" for rate in (240, 480, 960)}, "Rapier", (110.0, -30.0)),
    ("whole map", {"whole heightfield": ""}, "PyBullet, height field replaced", (-8.0, 12.0)),
    ("whole map", {"whole trimesh": ""}, "PyBullet, mesh rebuilt", (-60.0, 12.0)),
)  # fmt: skip
# Deviation after a second above which a body is far from where it belongs [m].
FAR = 1.0


def draw_panel(path: Path, results: Mapping[str, Result]) -> None:
    """Write the chart of `SCENE`, whose results these are."""
    figure = Figure(figsize=(8.0, 4.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(xscale="log", yscale="log", xlim=(0.5, 40.0), ylim=(0.006, 300.0))
    for family, names, title, shift in LINES:
        found = {name: results[name] for name in names if name in results and math.isfinite(distance_of(results[name]))}
        if not found:
            continue
        places = [(result.cost / 1e3, 1e3 * distance_of(result)) for result in found.values()]
        near = [place for place, result in zip(places, found.values(), strict=True) if result.deviation <= FAR]
        axes.plot(*zip(*near, strict=True), color=COLOURS[family], linewidth=1.5, alpha=0.5)
        for place, (name, result) in zip(places, found.items(), strict=True):
            inside = "white" if result.deviation > FAR else COLOURS[family]
            axes.plot(*place, "o", markersize=7, color=COLOURS[family], markerfacecolor=inside)
            axes.annotate(names[name], place, (6, -12), textcoords="offset points", fontsize=9, color=COLOURS[family])
        axes.annotate(
            title, places[0], shift, textcoords="offset points", fontsize=12, weight="bold", color=COLOURS[family]
        )
    axes.set_xlabel("cost: processor time for each body and simulated second [ms]", fontsize=11)
    axes.set_ylabel("distance from the ground, 99 % [mm]", fontsize=11)
    axes.set_title(f"{TITLE}. Lower left is better.", fontsize=11, loc="left")
    axes.text(0.99, 0.02, f"hollow: half of the bodies end more than {FAR:g} m from where they belong", ha="right",
              transform=axes.transAxes, fontsize=10, color="0.35")  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_tick_params(labelsize=11)
    axes.grid(visible=True, alpha=0.3)
    figure.savefig(path)


def main() -> None:
    """Draw the chart from the last run's figures."""
    found = read_results(Path("docs/accuracy.json"))["scenes"][SCENE]
    results = {name: Result(**{**values, "spread": tuple(values["spread"])}) for name, values in found.items()}
    draw_panel(Path("docs/images/accuracy/readme.png"), results)


if __name__ == "__main__":
    main()
