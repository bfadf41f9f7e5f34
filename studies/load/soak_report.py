"""Report of a soak: trends of the sampled figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.pages import fill, table

# The start is left out: buffers grow to the largest map and message, and pools of colliders fill. Share of the time.
WARM_UP = 0.2
# Samples in a row are alike; the slope's error is that of the means of so many blocks.
BLOCKS = 12
FIGURES = {
    "memory": ("resident memory, without DDS's segments", "MiB"),
    "descriptors": ("file descriptors", ""),
    "threads": ("threads", ""),
    "topics": ("topics", ""),
    "latency": ("latency of a service call", "ms"),
    "factor": ("real-time factor", ""),
}


class Slope(NamedTuple):
    """Change per hour, its standard error, and the median."""

    per_hour: float
    error: float
    median: float

    @property
    def flat(self) -> bool:
        """Return True if the slope is within two standard errors of zero, or below a hundredth of the median an
        hour."""
        return abs(self.per_hour) <= max(2.0 * self.error, 0.01 * abs(self.median))


def slope_of(times: NDArray[np.float64], values: NDArray[np.float64]) -> Slope:
    """The line through the means of blocks, by least squares; ``times`` in seconds."""
    if not np.ptp(values):
        return Slope(0.0, 0.0, float(values[0]))  # and not what rounding leaves
    t, v = (np.array([block.mean() for block in np.array_split(each, BLOCKS)]) for each in (times / 3600.0, values))
    (per_hour, _), covariance = np.polyfit(t, v, 1, cov=True)
    return Slope(float(per_hour), float(np.sqrt(covariance[0, 0])), float(np.median(values)))


def report(data: dict[str, Any], out: Path, page: Path | None) -> None:
    """The picture, and the table of the page."""
    samples = {name: np.array(values) for name, values in data["samples"].items()}
    kept = samples["time"] >= WARM_UP * samples["time"].max()
    slopes = {name: slope_of(samples["time"][kept], samples[name][kept]) for name in FIGURES}
    _draw(samples, slopes, data["minutes"], out / "soak.png")
    rows = []
    for name, (what, unit) in FIGURES.items():
        s = slopes[name]
        rows.append([what, f"{s.median:.4g} {unit}", f"{s.per_hour:+.3g} {unit} ± {s.error:.2g}",
                     "flat" if s.flat else "**changes**"])  # fmt: skip
    done = data["done"]
    words = (
        f"{data['minutes']:g} minutes: {done['sources killed']} sources killed and started with a map of another size, "
        f"{done['spawned']} bodies spawned and {done['removed']} removed, settings changed {done['settings changed']} "
        f"times. Bad messages and calls: {done['bad messages'] + done['bad calls']} sent, {data['refused']} refused by "
        f"the node's count. Bodies lost: {data['lost']} of {done['spawned']}; below the ground at the end: "
        f"{data['below_ground']}, at any sample at most {max(samples['below']):.0f}."
    )
    text = table(["figure", "median", "change per hour", ""], rows) + "\n\n" + words
    print(text)
    if page is not None:
        fill(page, {"soak": text})


def _draw(samples: dict[str, NDArray[np.float64]], slopes: dict[str, Slope], minutes: float, path: Path) -> None:
    figure = Figure(figsize=(11, 6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    time = samples["time"] / 60.0
    for axis, name in zip(axes.flat, ("memory", "descriptors", "latency", "factor"), strict=True):
        what, unit = FIGURES[name]
        axis.plot(time, samples[name], linewidth=0.8, color="#084594")
        axis.axvspan(0.0, WARM_UP * time.max(), color="grey", alpha=0.15, label="not in the slope")
        s = slopes[name]
        axis.set_title(f"{what}: {s.per_hour:+.3g} ± {s.error:.2g} {unit} per hour", fontsize=10)
        axis.set_ylabel(f"{what}{f' [{unit}]' if unit else ''}", fontsize=8)
        axis.set_ylim(bottom=0.0)
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8)
    for axis in axes[1]:
        axis.set_xlabel("time [min]")
    figure.suptitle(f"The node while everything around it changes, {minutes:g} minutes")
    figure.savefig(path, dpi=110)
