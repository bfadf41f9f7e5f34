"""A picture of corrected and of noisy maps under a box, processed in three ways; see docs/real_maps.md."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.motion import MotionConfig
from studies.configurations import BARE
from studies.matrix.real_maps import STEP, Site
from studies.report.config import ReportConfig


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
