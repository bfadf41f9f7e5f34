"""Pictures of cost against accuracy: distance from the ground and deviation from the reference, side by side."""

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
from matplotlib.transforms import Bbox

from studies.configurations import Family
from studies.contest import MEASURES, Measure, Result, distance_of, measures_of, pareto_front

COLOURS: dict[Family, str] = {
    "ours": "#0b6e4f", "ours, less": "#7bc8a4", "report": "#c1666b", "whole map": "#8d6a9f", "MuJoCo": "#1f77b4",
    "PhysX": "#e08e0b", "Rapier": "#6b6b6b",
}  # fmt: skip
MARKERS = dict(zip(COLOURS, "oosD^vP", strict=True))
PLAIN = FuncFormatter(lambda value, _: f"{value:g}")  # numbers without powers of ten
WORDS: dict[Measure, str] = {
    "distance": "from the ground while held up, 99 % [mm]",
    "deviation": "from the reference after 1 s, median [mm]",
}
# Pairs of panels in a row of the picture of all scenes.
PAIRS = 3
# The README's chart: one scene, legible at the width of a page.
README_SCENE = "waves_w04_maps_60"
README_TITLE = "48 balls on waves of 0.3 m, maps at 60 Hz"
# Each line: its family, the configurations of the study in it by what is written beside them, its name on the chart,
# and the shift of that name from the line's first point [points].
README_LINES: tuple[tuple[Family, dict[str, str], str, tuple[float, float]], ...] = (
    ("ours", {"defaults, 60 Hz": "60 Hz", "defaults, 120 Hz": "120 Hz", "defaults": "240 Hz",
              "defaults, 480 Hz": "480 Hz", "defaults, 960 Hz": "960 Hz"}, "smartmesh_ros", (-4.0, 12.0)),
    ("MuJoCo", {"MuJoCo tuned, 120 Hz": "120 Hz", "MuJoCo tuned, 240 Hz": "", "MuJoCo tuned, 480 Hz": "",
                "MuJoCo tuned, 960 Hz": "to 960 Hz", "MuJoCo tuned, 1920 Hz": "MuJoCo, 1920 Hz",
                "MuJoCo tuned, 7680 Hz": "MuJoCo, 7680 Hz"}, "MuJoCo", (-4.0, 14.0)),
    ("PhysX", {"PhysX, 240 Hz": "", "PhysX, 480 Hz": ""}, "PhysX", (10.0, -4.0)),
    ("Rapier", {f"Rapier stiff, {rate} Hz": "" for rate in (240, 480, 960)}, "Rapier", (60.0, -32.0)),
    ("whole map", {"whole heightfield": ""}, "PyBullet, height field replaced", (-8.0, 12.0)),
    ("whole map", {"whole trimesh": ""}, "PyBullet, mesh rebuilt", (-80.0, 12.0)),
)  # fmt: skip
# Deviation after a second above which a body is far from where it belongs [m].
FAR = 1.0


def draw_scene(path: Path, title: str, results: Mapping[str, Result], unit: str) -> None:
    """One scene: every configuration a point in both panels, ringed if it is on the front over cost and both; the front
    of each panel a line. ``unit``: what the cost is of."""
    figure = Figure(figsize=(17.0, 7.0), dpi=80)
    for column, measure in enumerate(MEASURES):
        axes = figure.add_axes((0.05 + 0.44 * column, 0.09, 0.385, 0.82))
        axes.set_ylabel(WORDS[measure])
        axes.set_xlabel(f"cost: update and step, per {unit} and simulated second [ms]")
        _plot(axes, measure, results, labels=True)
        if column == 0:
            axes.set_title(title, loc="left")
            handles = _legend(results.values())
            figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.89, 0.92), frameon=False, fontsize=9)
    figure.savefig(path)


def draw_all(path: Path, titles: Mapping[str, str], results: Mapping[str, Mapping[str, Result]], unit: str) -> None:
    """All scenes, by their names in ``titles``, as pairs of small charts on common axes."""
    rows = math.ceil(len(titles) / PAIRS)
    figure = Figure(figsize=(7.2 * PAIRS, 2.7 * rows + 0.8), layout="constrained")
    grid = figure.add_gridspec(rows, 2 * PAIRS)
    first: dict[Measure, Any] = {}
    for index, (scene, title) in enumerate(titles.items()):
        row, pair = divmod(index, PAIRS)
        for column, measure in enumerate(MEASURES):
            shared = first.get(measure)
            axes = figure.add_subplot(grid[row, 2 * pair + column], sharex=first.get("distance"), sharey=shared)
            first.setdefault(measure, axes)
            _plot(axes, measure, results[scene], labels=False)
            axes.tick_params(which="both", labelsize=7)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_minor_formatter(NullFormatter())
            if column == 0:
                axes.set_title(fill(title, max(40, round(0.6 * len(title)))), fontsize=8, loc="left")
            else:
                axes.set_title("deviation", fontsize=7, loc="right", color="0.4")
    handles = _legend([one for found in results.values() for one in found.values()])
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False)
    words = f"left: {WORDS['distance']}; right: {WORDS['deviation']}; crosses on top: lost"
    figure.supxlabel(f"cost: update and step, per {unit} and simulated second [ms]\n{words}")
    figure.savefig(path, dpi=80)


def _legend(results: Collection[Result]) -> list[Any]:
    """Return the entries of a legend, without families that have no points."""
    families = {one.family for one in results}
    handles: list[Any] = [
        Line2D([], [], linestyle="", marker=MARKERS[family], color=COLOURS[family], label=family)
        for family in COLOURS
        if family in families
    ]
    ring = Line2D(
        [], [], linestyle="", marker="o", color="white", markeredgecolor="black", label="front over all three"
    )
    return [*handles, ring, Line2D([], [], linestyle="--", color="0.35", linewidth=1.0, label="front of the panel")]


def _plot(axes: Any, measure: Measure, results: Mapping[str, Result], *, labels: bool) -> None:
    if measure not in measures_of(results):
        axes.text(0.5, 0.5, "no reference", ha="center", va="center", transform=axes.transAxes, color="0.5", fontsize=8)
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(PLAIN)
        axis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}" if f"{value:.0e}"[0] in "25" else ""))
        axis.set_tick_params(which="minor", labelsize=8)
    error_of, on_front = MEASURES[measure], set(pareto_front(results))
    run = {name: one for name, one in results.items() if one.cost > 0.0}
    spots = {name: (one.cost / 1e3, 1e3 * error_of(one)) for name, one in run.items() if math.isfinite(error_of(one))}
    top = 3.0 * max([10.0, *(error for _, error in spots.values())])
    lost = {name: (one.cost / 1e3, top) for name, one in run.items() if one.lost}
    for family in COLOURS:
        kept, gone = ([name for name in those if run[name].family == family] for those in (spots, lost))
        axes.scatter(
            [spots[name][0] for name in kept], [spots[name][1] for name in kept],
            c=COLOURS[family], marker=MARKERS[family], s=46 if labels else 22, zorder=3,
            edgecolors=["black" if name in on_front else "white" for name in kept],
            linewidths=[1.3 if name in on_front else 0.5 for name in kept],
        )  # fmt: skip
        axes.scatter([lost[name][0] for name in gone], [top] * len(gone), c=COLOURS[family], marker="x", zorder=3)
    front = [spots[name] for name in pareto_front(results, (measure,))]
    axes.step(
        [cost for cost, _ in front], [error for _, error in front], where="post", color="0.35", linewidth=1.0,
        linestyle="--", zorder=2,
    )  # fmt: skip
    axes.grid(visible=True, which="major", alpha=0.3)
    if labels:
        axes.margins(x=0.14, y=0.1)
        axes.autoscale_view()
        texts = {name: f"{name} ({one.lost} lost)" if one.lost else name for name, one in run.items()}
        _label(axes, spots | lost, texts, {name: COLOURS[one.family] for name, one in run.items()})


def _label(
    axes: Any, places: Mapping[str, tuple[float, float]], texts: Mapping[str, str], colours: Mapping[str, str]
) -> None:
    """Writes the names beside the points, each where it covers no other and stays within the panel."""
    right = axes.bbox.x1
    spots = {name: axes.transData.transform(place) for name, place in places.items()}
    taken: list[Bbox] = []
    for name, (x, y) in spots.items():
        text = texts[name]
        width = 4.6 * len(text)
        offsets = [(6.0, 10.0 * shift + 6.0) for shift in (0, -1, 1, -2, 2, -3, 3, -4, 4)]
        offsets += [(-width - 6.0, offset) for _, offset in offsets]
        boxes = [Bbox.from_bounds(x + dx, y + dy, width, 9.0) for dx, dy in offsets]
        free = (index for index, box in enumerate(boxes) if box.x1 <= right and not box.count_overlaps(taken))
        chosen = next(free, 0)
        dx, dy = offsets[chosen]
        taken.append(boxes[chosen])
        axes.annotate(
            text, (x, y), xycoords="figure pixels", xytext=(x + dx, y + dy), textcoords="figure pixels", fontsize=7,
            color=colours[name], va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": "0.8", "linewidth": 0.5} if abs(dy) > 12.0 else None,
        )  # fmt: skip


def draw_readme(path: Path, results: Mapping[str, Result]) -> None:
    """Write the chart of `README_SCENE`, whose results these are."""
    figure = Figure(figsize=(8.0, 4.6), dpi=100, layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlim=(0.25, 40.0), ylim=(0.006, 300.0))
    for family, names, title, shift in README_LINES:
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
    axes.set_title(f"{README_TITLE}. Lower left is better.", fontsize=11, loc="left")
    axes.text(0.99, 0.02, f"hollow: half of the bodies end more than {FAR:g} m from where they belong", ha="right",
              transform=axes.transAxes, fontsize=10, color="0.35")  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(PLAIN)
        axis.set_tick_params(labelsize=11)
    axes.grid(visible=True, alpha=0.3)
    figure.savefig(path)
