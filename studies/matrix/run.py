"""Runs the matrix, and writes it as a table and as a picture."""

import math
import multiprocessing
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from smartmesh_ros import InputError, MotionConfig
from studies.configurations import BARE
from studies.matrix import moving_ground, real_maps, rules, sleeping, still_ground, touching
from studies.matrix.arena import METHODS, Outcome, Row
from studies.matrix.real_maps import STEP, Site
from studies.pages import say, table
from studies.report.config import ReportConfig

_PARTS = (still_ground, moving_ground, rules, touching, real_maps, sleeping)
ROWS: tuple[Row, ...] = tuple(row for part in _PARTS for row in part.ROWS)
QUICK_METHODS = ("defaults", "rebuilt trimesh")


def run_cell(row: Row, method: str) -> Outcome:
    """One row for one method."""
    figure: float | None = None
    if method not in row.skip:
        try:
            figure = float(row.figure(METHODS[method]))
        except InputError:  # the method cannot do it
            figure = math.inf
    return Outcome(row=row, method=method, figure=figure)


def run_matrix(*, quick: bool = False, methods: Sequence[str] = ()) -> list[Outcome]:
    """All cells, row by row, or those of some ``methods``; the quick run has fewer rows and methods.

    Each cell runs in a process of its own, on all cores: PyBullet keeps the memory of every mesh that was replaced,
    gigabytes in a row of moving whole meshes.
    """
    chosen = tuple(methods) or (QUICK_METHODS if quick else tuple(METHODS))
    cells = [(index, method) for index, row in enumerate(ROWS) if row.quick or not quick for method in chosen]
    outcomes = []
    with multiprocessing.get_context("fork").Pool(maxtasksperchild=1) as pool:
        for (index, method), figure in zip(cells, pool.imap(_figure_of, cells), strict=True):
            outcomes.append(Outcome(row=ROWS[index], method=method, figure=figure))
            say(f"stability: {ROWS[index].name}, {method}")
    return outcomes


def _figure_of(cell: tuple[int, str]) -> float | None:
    """Run a cell by the number of its row: functions of rows cannot be sent to another process."""
    return run_cell(ROWS[cell[0]], cell[1]).figure


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
        row = found[0].row
        rows.append([row.name, f"{row.limit:g} {row.unit}", row.source, *texts])
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
        rowLabels=[f"{row.name}  (<= {row.limit:g} {row.unit})" for row in (one.row for one in cells[:, 0])],
        colLabels=methods,
        colWidths=[1.0 / len(methods)] * len(methods), bbox=Bbox.unit(),
    )  # fmt: skip
    for (row, column), cell in drawn.get_celld().items():
        failed = row > 0 <= column and cells[row - 1, column].passed is False
        cell.set_edgecolor("white")
        cell.set_text_props(fontsize=8, weight="bold" if failed else "normal")
    axes.set_axis_off()
    axes.set_title("Stability: green passes, red fails its limit; figures in the limit's unit", fontsize=10)
    figure.savefig(path, dpi=100)


def draw_box(path: Path, seconds: float = 5.0) -> None:
    """A box on ground that is corrected, and on ground with noise, in three ways to process maps: PyBullet whose
    heightfield is replaced by each map, ours as motion of exact heights, and ours as corrections."""
    by, noise = 0.1, 0.01  # [m]
    figure = Figure((9.0, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    replaced = ReportConfig(kind="whole_heightfield", guard=False, **BARE)
    for name, colour, report, motion in (
        ("PyBullet, heightfield replaced", "#9a9a9a", replaced, MotionConfig(mode="hold")),
        ("as motion (before)", "#d1605e", None, MotionConfig()),
        ("as corrections (now)", "#2f6fab", None, MotionConfig(changes="correction")),
    ):  # fmt: skip
        with Site(report, "box", motion=motion) as site:
            rest = site.states(1.0)[-1].position[2]
            site.tell(site.level)
            states = site.states(0.2)
            site.tell(site.level + by)
            moved = 1e3 * (np.array([state.position[2] for state in [*states, *site.states(1.3)]]) - rest)
        left.plot(STEP * np.arange(len(moved)) - 0.2, moved, color=colour, label=name, linewidth=1.4)
        known = replace(motion, noise=noise if motion.changes == "correction" else 0.0)
        with Site(report, "box", motion=known) as site:
            rest = site.state.position[2]
            moved = 1e3 * (np.array([state.position[2] for state in site.in_noise(noise, seconds)]) - rest)
        right.plot(STEP * np.arange(len(moved)), moved, color=colour, linewidth=1.0)
    left.axhline(1e3 * by, color="black", linewidth=0.6, linestyle=":")
    left.set(title=f"a loop closure corrects the ground by {100 * by:g} cm", xlabel="time [s]",
             ylabel="box over its old rest [mm]")  # fmt: skip
    right.set(title=f"white noise of {1e3 * noise:g} mm at 20 Hz", xlabel="time [s]", ylabel="box over its rest [mm]")
    left.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=90)
