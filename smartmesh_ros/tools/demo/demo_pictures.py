"""Pictures of the demo from above: the terrain, the patches and the bodies on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.animation import PillowWriter
from matplotlib.collections import PolyCollection
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from numpy.typing import NDArray

# Ground drawn beyond the outermost bodies [m].
MARGIN = 2.0
COLOURS = colormaps["gist_earth"]
# Extension of the colour range below the lowest height, as a fraction of the height range. It skips the blue part of
# the colour map, which would look like water.
BLUE_SHARE = 0.6
PATCH_COLOUR = "#f28c28"
BODY_COLOURS = {"ball": "#1f4e9c", "box": "#7a1f6b", "can": "#0b6b4f", "husky": "#c1121f"}
OTHER_COLOUR, EDGES = "#202020", "#4d2600"
# Bounds in x and y of a part of the ground [m].
Window = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Frame:
    """The scene at a ``time`` [s]: ``heights`` (n, m) [m] of the ground in rows at ``y`` (n,) and columns at ``x`` (m,)
    [m], ``triangles`` of the patches (T, 3, 3) [m], and positions [m] of the ``bodies`` by name."""

    time: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heights: NDArray[np.float32]
    triangles: NDArray[np.float64]
    bodies: dict[str, tuple[float, float, float]]


def draw(frames: list[Frame], folder: Path) -> Iterator[Path]:
    """Write a picture of six frames and a clip into a folder that exists; yield each path once it is written."""
    yield _picture(frames, folder / "demo.png")
    yield _clip(frames, folder / "demo.gif")


def window_of(frames: list[Frame]) -> Window:
    """Return the square of ground around all bodies of the frames, or the whole map if there are no bodies."""
    first = frames[0]
    corners = [(first.x[0], first.y[0]), (first.x[-1], first.y[-1])]
    places = np.array([place[:2] for frame in frames for place in frame.bodies.values()] or corners)
    low, high = places.min(axis=0), places.max(axis=0)
    (x, y), half = 0.5 * (low + high), 0.5 * float((high - low).max()) + MARGIN
    return (x - half, x + half), (y - half, y + half)


def _shade(heights: NDArray[np.float32], step: float) -> NDArray[np.float64]:
    """Return colours (n, m, 4) of heights (n, m) [m] at spacing ``step`` [m], lit from the north-west."""
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    base = low - BLUE_SHARE * max(high - low, 0.1)
    return np.asarray(LightSource(315, 45).shade(heights, COLOURS, vert_exag=2.0, dx=step, dy=step, vmin=base))


def _mark(name: str) -> dict[str, Any]:
    """Return the look of the marker of a body, whose name up to the underscore is its kind."""
    kind = name.partition("_")[0]
    return {
        "label": kind, "linestyle": "", "marker": "s" if kind in ("box", "husky") else "o",
        "color": BODY_COLOURS.get(kind, OTHER_COLOUR),
        "markersize": 9 if kind == "husky" else 4, "markeredgecolor": "white", "markeredgewidth": 0.5,
    }  # fmt: skip


def _plan(axes: Any, frame: Frame, window: Window) -> None:
    ends = (np.searchsorted(*axis) for axis in zip((frame.x, frame.y), window, strict=True))
    columns, rows = (slice(max(first - 1, 0), last + 1) for first, last in ends)  # to the samples beside the window
    x, y = frame.x[columns], frame.y[rows]
    image = _shade(frame.heights[rows, columns], float(x[1] - x[0]))
    axes.imshow(image, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), interpolation="bilinear")
    outlines = [*frame.triangles[:, :, :2]]
    axes.add_collection(PolyCollection(outlines, facecolor=PATCH_COLOUR, edgecolor=EDGES, linewidth=0.2, alpha=0.75))
    for name, (left, low, _) in frame.bodies.items():
        axes.plot(left, low, **_mark(name))
    axes.set(xlim=window[0], ylim=window[1], xticks=[], yticks=[], title=f"{frame.time:.1f} s")
    axes.title.set_fontsize(10)


def _picture(frames: list[Frame], path: Path) -> Path:
    chosen = [frames[int(index)] for index in np.linspace(0, len(frames) - 1, 6)]
    window = window_of(frames)
    figure = Figure(figsize=(12, 8.8), dpi=100, layout="constrained")
    grid = figure.subplots(2, 3)
    for axes, frame in zip(grid.ravel(), chosen, strict=True):
        _plan(axes, frame, window)
    kinds = {mark["label"]: mark for mark in map(_mark, frames[-1].bodies)}
    marks = [grid[0, 0].plot([], [], **mark)[0] for mark in kinds.values()]
    marks += grid[0, 0].plot([], [], "s", color=PATCH_COLOUR, label="patch")
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks), frameon=False)
    figure.suptitle("A wave travels over a real elevation model: patches follow the bodies")
    figure.savefig(path)
    return path


def _clip(frames: list[Frame], path: Path) -> Path:
    chosen = frames[:: math.ceil(len(frames) / 30)]
    window = window_of(frames)
    figure = Figure(figsize=(5, 5), dpi=80, layout="constrained")
    axes, writer = figure.subplots(), PillowWriter(fps=6)
    with writer.saving(figure, path, figure.dpi):
        for frame in chosen:
            axes.clear()
            _plan(axes, frame, window)
            writer.grab_frame()
    return path
