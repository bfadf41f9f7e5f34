"""The matrix as a table and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig
from studies.configurations import BARE
from studies.markdown import table
from studies.matrix.real_maps import STEP, Site
from studies.matrix.row import Outcome

COLOURS = {True: "#cfe8d5", False: "#f4c7c3", None: "#eeeeee"}  # by whether a cell passes


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
    axes = figure.add_subplot()
    for outcome in outcomes:
        x, y = methods.index(outcome.method), rows.index(outcome.row)
        colour = COLOURS[outcome.passed]
        axes.add_patch(Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", linewidth=1.5))
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


class Way(NamedTuple):
    """A way to process maps, and its physics and colliders."""

    name: str
    colour: str
    motion: MotionConfig
    physics: PhysicsConfig = PhysicsConfig()
    patch: PatchConfig = PatchConfig()


def ways(noise: float) -> tuple[Way, ...]:
    """Ours as corrections of such a noise [m], ours as motion of exact heights, and PyBullet whose heightfield is
    replaced by each map."""
    return (
        Way("PyBullet, heightfield replaced", "#9a9a9a", MotionConfig(mode="hold"),
            PhysicsConfig(guard=False), PatchConfig(kind="whole_heightfield", **BARE)),
        Way("as motion (before)", "#d1605e", MotionConfig()),
        Way("as corrections (now)", "#2f6fab", MotionConfig(changes="correction", noise=noise)),
    )  # fmt: skip


def corrected(way: Way, by: float) -> FloatArray:
    """Height of a body over where it was [m], for 0.2 s before its ground is corrected and 1.3 s after."""
    with Site(way.patch, "box", motion=way.motion, physics=way.physics) as site:
        rest = [state.position[2] for state in site.states(1.0)][-1]
        site.tell(site.level)
        before = [state.position[2] for state in site.states(0.2)]
        site.tell(site.level + by)
        return np.array(before + [state.position[2] for state in site.states(1.3)]) - rest


def noisy(way: Way, noise: float, seconds: float) -> FloatArray:
    """Return the height of a body over its true rest [m] on ground whose maps have white noise [m]."""
    with Site(way.patch, "box", motion=way.motion, physics=way.physics) as site:
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
