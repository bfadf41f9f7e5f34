"""The chart of the times of a step's stages."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic
from typing import Any

import numpy as np
from viser import uplot

from smartmesh_ros.terrain.grid import FloatArray

# Time span of the chart and period of its refreshes [s].
MINUTE, PERIOD = 60.0, 1.0
# Stages of a step in the chart, and their colours.
STAGES = {
    "total": "#222222", "step": "#1f77b4", "search": "#2ca02c", "collider": "#ff7f0e", "publish": "#9467bd",
    "bodies": "#8c564b",
}  # fmt: skip
# Times above this many times what a stage rarely exceeds are cut, so that a stall does not flatten the rest. Rarely: in
# this share of the messages.
CUT, RARELY = 2.0, 0.1


class Chart:
    """The medians of `STAGES` over the last minute."""

    def __init__(self, gui: Any) -> None:
        self._due = 0.0
        self._plot = gui.add_uplot(
            data=chart_data([], 0.0)[0],
            series=({"label": "s"}, *({"label": name, "stroke": line, "width": 2} for name, line in STAGES.items())),
            scales={"x": {"time": False, "range": [-MINUTE, 0.0]}},
            aspect=1.3,
            legend=uplot.Legend(live=False),  # live values would be those under the mouse only
        )

    def update(self, timings: Sequence[tuple[float, Any]]) -> None:
        """Show messages of ~/timing with their times [s], if it is time for that."""
        if (now := monotonic()) >= self._due:
            self._due = now + PERIOD
            self._plot.data, self._plot.title = chart_data(timings, now)


def chart_data(timings: Sequence[tuple[float, Any]], now: float) -> tuple[tuple[FloatArray, ...], str | None]:
    """Return times relative to ``now`` [s] with the median of each of `STAGES` [ms], cut where it is far too long, and
    words on what was cut (None = nothing), from messages of ~/timing with their times [s]."""
    recent = [(came, message) for came, message in timings if came > now - MINUTE]
    medians = np.full((len(STAGES), len(recent)), np.nan)
    for column, (_, message) in enumerate(recent):
        known = {stage.stage: 1e-3 * stage.p50_us for stage in message.stages}
        medians[:, column] = [known.get(stage, np.nan) for stage in STAGES]
    usual = np.quantile(np.nan_to_num(medians), 1.0 - RARELY, axis=1, method="lower") if recent else np.zeros(1)
    most = CUT * usual.max() or np.inf
    words = None
    if (cut := (medians > most).any(axis=0)).any():
        last = now - recent[np.flatnonzero(cut)[-1]][0]
        words = f"{cut.sum()} x cut, at most {np.nanmax(medians):.0f} ms, the last {last:.0f} s ago"
    return (np.array([came - now for came, _ in recent]), *np.minimum(medians, most)), words
