"""Pictures of the demo: the terrain, the patches and the bodies on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.collections import PolyCollection
from matplotlib.colors import LightSource
from matplotlib.patches import Rectangle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

# Ground drawn beyond the outermost bodies [m], and most quadrilaterals along a side of it, which matplotlib sorts.
MARGIN, MOST_CELLS = 2.0, 150
# Height above the ground at which patches are drawn [m].
LIFT = 0.05
# Frames of the clip between two lines about it.
TOLD_EVERY = 10
COLOURS = plt.get_cmap("gist_earth")
# Extension of the colour range below the lowest height, as a fraction of the height range. It skips the blue part of
# the colour map, which would look like water.
BLUE_SHARE = 0.6
PATCH_COLOUR = "#f28c28"
BODY_COLOURS = {"ball": "#1f4e9c", "box": "#7a1f6b", "can": "#0b6b4f", "husky": "#c1121f"}
OTHER_COLOUR, EDGES = "#202020", "#4d2600"


class Window(NamedTuple):
    """A square of the ground, by its edges [m]."""

    left: float
    right: float
    low: float
    high: float


@dataclass(frozen=True)
class Frame:
    """The recorded scene at one time: ``heights`` (n, m) [m] of the ground in rows at ``y`` (n,) and columns at ``x``
    (m,) [m], ``triangles`` of the patches (T, 3, 3) [m], and positions [m] of the ``bodies`` by name."""

    time: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heights: NDArray[np.float32]
    triangles: NDArray[np.float64]
    bodies: dict[str, tuple[float, float, float]]

    def within(self, window: Window) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
        """Return x (m,), y (n,) and heights (n, m) [m] of the ground in a window, at most `MOST_CELLS` along a side."""
        columns = np.flatnonzero((self.x >= window.left) & (self.x <= window.right))
        rows = np.flatnonzero((self.y >= window.low) & (self.y <= window.high))
        stride = math.ceil(max(len(columns), len(rows)) / MOST_CELLS)
        columns, rows = columns[::stride], rows[::stride]
        return self.x[columns], self.y[rows], self.heights[np.ix_(rows, columns)]


def draw(frames: list[Frame], folder: Path, say: Callable[[str], object] = lambda _: None) -> Iterator[Path]:
    """Write a picture, a strip of six frames and a clip; yield each path once it is written. ``say`` is told how far
    the clip is."""
    folder.mkdir(parents=True, exist_ok=True)
    yield _picture(frames[-1], folder / "demo.png")
    yield _strip(frames, folder / "demo_frames.png")
    yield _clip(frames, folder / "demo.gif", say)


def window_of(frames: list[Frame]) -> Window:
    """Return the square of ground around all bodies of the frames, or the whole map if there are no bodies."""
    first = frames[0]
    corners = [(first.x[0], first.y[0]), (first.x[-1], first.y[-1])]
    places = np.array([place[:2] for frame in frames for place in frame.bodies.values()] or corners)
    low, high = places.min(axis=0), places.max(axis=0)
    (x, y), half = 0.5 * (low + high), 0.5 * float((high - low).max()) + MARGIN
    return Window(float(x) - half, float(x) + half, float(y) - half, float(y) + half)


def _picture(frame: Frame, path: Path) -> Path:
    """Draw the ground around the bodies in relief, beside a plan of the whole terrain; return ``path``."""
    figure = plt.figure(figsize=(13, 7.5), dpi=110)
    window = window_of([frame])
    # The box of a three-dimensional plot fills about two thirds of its axes, so these reach beyond the figure's part.
    relief: Any = figure.add_axes((-0.04, -0.01, 0.82, 0.97), projection="3d", computed_zorder=False)
    _relief(relief, frame, window)
    plan: Any = figure.add_axes((0.72, 0.08, 0.26, 0.42))
    whole = Window(frame.x[0], frame.x[-1], frame.y[0], frame.y[-1])
    _plan(plan, frame, whole, 0.5)
    width, height = window.right - window.left, window.high - window.low
    plan.add_patch(Rectangle((window.left, window.low), width, height, fill=False, linewidth=1.2))
    plan.set_title(f"The whole terrain, {whole.right - whole.left:.0f} m x {whole.high - whole.low:.0f} m", fontsize=10)
    for kind in dict.fromkeys(map(_kind, frame.bodies)):
        relief.plot([], [], linestyle="", label=kind, **_mark(kind, 2.0))
    relief.plot([], [], "s", color=PATCH_COLOUR, label="patch")
    figure.legend(loc="upper left", bbox_to_anchor=(0.76, 0.86), frameon=False, fontsize=12)
    figure.suptitle("A wave travels over a real elevation model: patches follow the bodies", y=0.96)
    figure.savefig(path)
    plt.close(figure)
    return path


def _relief(axes: Any, frame: Frame, window: Window) -> None:
    """Draw the ground of a window, then its patches, then the bodies, each over the layer before: matplotlib sorts
    faces by their centres, and would hide halves of patches."""
    x, y, z = frame.within(window)
    shade = _shade(z, float(x[1] - x[0]))
    axes.plot_surface(*np.meshgrid(x, y), z, rstride=1, cstride=1, facecolors=shade, shade=False)
    lifted = [*(frame.triangles + np.array([0.0, 0.0, LIFT]))]
    axes.add_collection3d(Poly3DCollection(lifted, facecolors=PATCH_COLOUR, edgecolors=EDGES, linewidths=0.25))
    for name, place in frame.bodies.items():
        axes.plot(*([value] for value in place), **_mark(name, 2.0))
    for layer in (*axes.collections, *axes.lines):  # else they end at the edges of the axes
        layer.set_clip_on(False)
    low, high = float(np.nanmin(z)), max(float(np.nanmax(z)), float(np.nanmin(z)) + 0.1)
    axes.set(xlim=window[:2], ylim=window[2:], zlim=(low, high))
    axes.set_box_aspect((window.right - window.left, window.high - window.low, high - low), zoom=1.2)
    axes.view_init(elev=48, azim=-60)
    axes.set_axis_off()


def _shade(heights: NDArray[np.float32], step: float) -> NDArray[np.float64]:
    """Return colours (n, m, 4) of heights (n, m) [m] at spacing ``step`` [m], lit from the north-west."""
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    base = low - BLUE_SHARE * max(high - low, 0.1)
    return np.asarray(LightSource(315, 45).shade(heights, COLOURS, vert_exag=2.0, dx=step, dy=step, vmin=base))


def _kind(name: str) -> str:
    """Return the kind of a body of the demo: its name up to the underscore."""
    return name.split("_")[0]


def _mark(name: str, scale: float = 1.0) -> dict[str, Any]:
    """Return the look of a body's marker, ``scale`` times as large as in a plan."""
    kind = _kind(name)
    return {
        "marker": "s" if kind in ("box", "husky") else "o", "color": BODY_COLOURS.get(kind, OTHER_COLOUR),
        "markersize": scale * (9 if kind == "husky" else 4), "markeredgecolor": "white", "markeredgewidth": 0.5 * scale,
    }  # fmt: skip


def _plan(axes: Any, frame: Frame, window: Window, scale: float = 1.0) -> None:
    """Draw the ground, the patches and the bodies of a window from above."""
    x, y, z = frame.within(window)
    image = _shade(z, float(x[1] - x[0]))
    axes.imshow(image, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), interpolation="bilinear")
    outlines = [*frame.triangles[:, :, :2]]
    axes.add_collection(PolyCollection(outlines, facecolor=PATCH_COLOUR, edgecolor=EDGES, linewidth=0.2, alpha=0.75))
    for name, (left, low, _) in frame.bodies.items():
        axes.plot(left, low, **_mark(name, scale))
    axes.set(xlim=window[:2], ylim=window[2:], xticks=[], yticks=[], title=f"{frame.time:.1f} s")
    axes.title.set_fontsize(10)


def _strip(frames: list[Frame], path: Path) -> Path:
    chosen = [frames[int(index)] for index in np.linspace(0, len(frames) - 1, 6)]
    window = window_of(frames)
    figure, grid = plt.subplots(2, 3, figsize=(12, 8.4), dpi=100, constrained_layout=True)
    for axes, frame in zip(grid.ravel(), chosen, strict=True):
        _plan(axes, frame, window)
    figure.savefig(path)
    plt.close(figure)
    return path


def _clip(frames: list[Frame], path: Path, say: Callable[[str], object]) -> Path:
    chosen = frames[:: math.ceil(len(frames) / 30)]
    window = window_of(frames)
    figure, axes = plt.subplots(figsize=(5, 5), dpi=80, constrained_layout=True)

    def show(index: int) -> list[Any]:
        axes.clear()
        _plan(axes, chosen[index], window)
        return []

    def tell(index: int, count: int) -> None:
        if index and index % TOLD_EVERY == 0:
            say(f"{index} of {count} frames of the clip")

    FuncAnimation(figure, show, frames=len(chosen)).save(path, writer=PillowWriter(fps=6), progress_callback=tell)
    plt.close(figure)
    return path
