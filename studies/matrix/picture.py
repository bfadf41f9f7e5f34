"""The matrix as a table and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig
from studies.configurations import BARE
from studies.matrix.real_maps import STEP, Site
from studies.matrix.row import Outcome
from studies.pages import table
from studies.report.config import ReportConfig

COLOURS = {True: "#cfe8d5", False: "#f4c7c3", None: "#eeeeee"}  # by whether a cell passes


def figure_text(outcome: Outcome) -> str:
    """The figure of a cell, short."""
    value = outcome.figure
    if value is None:
        return "-"
    if not math.isfinite(value):
        return "fails"
    return f"{value:.0f}" if value == round(value) or abs(value) >= 99.5 else f"{value:.2g}"


def _cells(outcomes: Sequence[Outcome]) -> tuple[list[str], Any]:
    """Return the methods, and the outcomes as an array (rows, methods)."""
    methods = list(dict.fromkeys(outcome.method for outcome in outcomes))
    return methods, np.array(outcomes, object).reshape(-1, len(methods))


def matrix_table(outcomes: Sequence[Outcome]) -> str:
    """The matrix in Markdown; figures beyond their limit are bold."""
    methods, cells = _cells(outcomes)
    rows = []
    for found in cells:
        texts = [f"**{figure_text(o)}**" if o.passed is False else figure_text(o) for o in found]
        rows.append([found[0].row, f"{found[0].limit:g} {found[0].unit}", found[0].source, *texts])
    verdicts = [[o.passed for o in column] for column in cells.T]
    rows.append(["passed", "", "", *[f"{one.count(True)} of {len(one) - one.count(None)}" for one in verdicts]])
    return table(["test", "limit", "source of the limit", *methods], rows)


def draw_matrix(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Green cells pass, red ones fail; each shows its figure."""
    methods, cells = _cells(outcomes)
    figure = Figure(figsize=(4.2 + 1.15 * len(methods), 1.0 + 0.26 * len(cells)), layout="tight")
    axes = figure.add_subplot()
    drawn = axes.table(
        cellText=[[figure_text(one) for one in row] for row in cells], cellLoc="center",
        cellColours=[[COLOURS[one.passed] for one in row] for row in cells],
        rowLabels=[f"{one.row}  (<= {one.limit:g} {one.unit})" for one in cells[:, 0]], colLabels=methods,
        colWidths=[1.0 / len(methods)] * len(methods), bbox=Bbox.unit(),
    )  # fmt: skip
    for (row, column), cell in drawn.get_celld().items():
        failed = row > 0 <= column and cells[row - 1, column].passed is False
        cell.set_edgecolor("white")
        cell.set_text_props(fontsize=8, weight="bold" if failed else "normal")
    axes.set_axis_off()
    axes.set_title("Stability: green passes, red fails its limit; figures in the limit's unit", fontsize=10)
    figure.savefig(path, dpi=100)


class Way(NamedTuple):
    """A way to process maps, and the report's colliders, None = contacts from the map."""

    name: str
    colour: str
    motion: MotionConfig
    report: ReportConfig | None = None


def ways(noise: float) -> tuple[Way, ...]:
    """Ours as corrections of such a noise [m], ours as motion of exact heights, and PyBullet whose heightfield is
    replaced by each map."""
    return (
        Way("PyBullet, heightfield replaced", "#9a9a9a", MotionConfig(mode="hold"),
            ReportConfig(kind="whole_heightfield", guard=False, **BARE)),
        Way("as motion (before)", "#d1605e", MotionConfig()),
        Way("as corrections (now)", "#2f6fab", MotionConfig(changes="correction", noise=noise)),
    )  # fmt: skip


def corrected(way: Way, by: float) -> FloatArray:
    """Height of a body over where it was [m], for 0.2 s before its ground is corrected and 1.3 s after."""
    with Site(way.report, "box", motion=way.motion) as site:
        rest = [state.position[2] for state in site.states(1.0)][-1]
        site.tell(site.level)
        before = [state.position[2] for state in site.states(0.2)]
        site.tell(site.level + by)
        return np.array(before + [state.position[2] for state in site.states(1.3)]) - rest


def noisy(way: Way, noise: float, seconds: float) -> FloatArray:
    """Return the height of a body over its true rest [m] on ground whose maps have white noise [m]."""
    with Site(way.report, "box", motion=way.motion) as site:
        rest = site.state.position[2]
        return np.array([state.position[2] for state in site.in_noise(noise, seconds)]) - rest


def draw_box(path: Path, seconds: float = 5.0) -> None:
    """A correction and noise, each in the three ways."""
    by, noise = 0.1, 0.01  # [m]
    figure = Figure((9.0, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for way in ways(0.0):
        moved = 1e3 * corrected(way, by)
        left.plot(STEP * np.arange(len(moved)) - 0.2, moved, color=way.colour, label=way.name, linewidth=1.4)
    left.axhline(1e3 * by, color="black", linewidth=0.6, linestyle=":")
    left.set(title=f"a loop closure corrects the ground by {100 * by:g} cm", xlabel="time [s]",
             ylabel="box over its old rest [mm]")  # fmt: skip
    for way in ways(noise):
        moved = 1e3 * noisy(way, noise, seconds)
        right.plot(STEP * np.arange(len(moved)), moved, color=way.colour, linewidth=1.0)
    right.set(title=f"white noise of {1e3 * noise:g} mm at 20 Hz", xlabel="time [s]", ylabel="box over its rest [mm]")
    left.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=90)
