"""A picture of one map beside the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from studies.mapper.mapping import MapFrame


def draw_frame(path: Path, frame: MapFrame) -> None:
    """The true ground, the map, the standard deviation it claims and its error; grey = never seen. A PNG file."""
    figure = Figure(figsize=(15.0, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 4, sharex=True, sharey=True)
    low, high = np.nanmin(frame.truth), np.nanmax(frame.truth)
    error = 1e3 * frame.error
    worst = float(np.nanpercentile(np.abs(error), 99.0)) if np.isfinite(error).any() else 1.0
    deviation = 1e3 * np.sqrt(frame.variance)
    _draw(axes[0], frame, frame.truth, "true ground [m]", vmin=low, vmax=high, cmap="terrain")
    _draw(axes[1], frame, frame.elevation, "elevation [m]", vmin=low, vmax=high, cmap="terrain")
    _draw(axes[2], frame, deviation, "standard deviation [mm]", vmin=0.0, cmap="viridis")
    _draw(axes[3], frame, error, "error [mm]", vmin=-worst, vmax=worst, cmap="RdBu_r")
    x, y, z = (1e3 * (e - t) for e, t in zip(frame.estimate[:3], frame.pose[:3], strict=True))
    closed = ", a loop just closed" if frame.closed else ""
    figure.suptitle(f"{frame.stamp:.1f} s{closed}; the pose is off by ({x:.0f}, {y:.0f}, {z:.0f}) mm", fontsize=11)
    figure.savefig(path, dpi=100)


def _draw(axes: Any, frame: MapFrame, layer: Any, title: str, **look: Any) -> None:
    """One layer, with the rover where it is and, hollow, where it takes itself to be."""
    geometry = frame.geometry
    (x, y, _), half = geometry.origin, 0.5 * geometry.resolution
    extent = (
        x - half,
        x + (geometry.columns - 0.5) * geometry.resolution,
        y - half,
        y + (geometry.rows - 0.5) * geometry.resolution,
    )
    axes.set_facecolor("#bbbbbb")
    picture = axes.imshow(layer, origin="lower", extent=extent, interpolation="nearest", **look)
    axes.plot(frame.pose.x, frame.pose.y, "k.", markersize=6)
    axes.plot(frame.estimate.x, frame.estimate.y, "ko", markersize=9, fillstyle="none")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("x [m]")
    axes.figure.colorbar(picture, ax=axes, shrink=0.8)
