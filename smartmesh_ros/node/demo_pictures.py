"""Pictures of the demo: the terrain, the patches and the bodies on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from smartmesh_msgs.msg import Heightmap, TrackedBodyArray
from visualization_msgs.msg import MarkerArray

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.collections import PolyCollection
from matplotlib.colors import LightSource
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

# Half the width of the ground that is drawn around the bodies [m].
REACH = 11.0
COLOURS = plt.get_cmap("gist_earth")
PATCH_COLOUR = "#f28c28"
BODY_COLOURS = {"ball": "#1f4e9c", "box": "#7a1f6b", "can": "#0b6b4f", "husky": "#c1121f"}


class Placed(NamedTuple):
    """A body's position [m] and orientation (x, y, z, w)."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]

    def points(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) of the body's own frame in the terrain's."""
        x, y, z, w = self.orientation
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return np.asarray(local @ turn.T + self.position)


@dataclass(frozen=True)
class Frame:
    """What was seen at one time: ground, patches' triangles (T, 3, 3) [m], and bodies by name."""

    time: float
    heights: NDArray[np.float32]
    resolution: float
    origin: tuple[float, float]
    triangles: NDArray[np.float64]
    bodies: dict[str, Placed]

    def window(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
        """x (m,) and y (n,) [m] and heights (n, m) of the ground around the middle."""
        rows, columns = self.heights.shape
        x = self.origin[0] + np.arange(columns) * self.resolution
        y = self.origin[1] + np.arange(rows) * self.resolution
        inner_x, inner_y = np.abs(x) <= REACH, np.abs(y) <= REACH
        return x[inner_x], y[inner_y], self.heights[np.ix_(inner_y, inner_x)]


class Snapshot(NamedTuple):
    """The newest messages at a time [s] of the demo, as bytes by topic."""

    time: float
    messages: dict[str, bytes]


def frame_of(snapshot: Snapshot) -> Frame:
    """A frame of the newest messages."""
    kinds = {"heightmap": Heightmap, "patches": MarkerArray, "body_states": TrackedBodyArray}
    heightmap, patches, states = (deserialize_message(snapshot.messages[topic], kind) for topic, kind in kinds.items())
    info = heightmap.info
    heights = np.frombuffer(heightmap.heights, np.float32).reshape(info.height, info.width)
    points = [(p.x, p.y, p.z) for marker in patches.markers for p in marker.points]
    bodies = {}
    for body in states.bodies:
        p, q = body.pose.position, body.pose.orientation
        bodies[body.id] = Placed((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
    origin = (info.origin.position.x, info.origin.position.y)
    return Frame(snapshot.time, heights, info.resolution, origin, np.array(points).reshape(-1, 3, 3), bodies)


def draw(snapshots: list[Snapshot], folder: Path) -> list[Path]:
    """Writes a picture of the last snapshot, a strip of six and a clip; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    frames = [frame_of(snapshot) for snapshot in snapshots]
    return [
        _picture(frames[-1], folder / "demo.png"),
        _strip(frames, folder / "demo_frames.png"),
        _clip(frames, folder / "demo.gif"),
    ]


def _solid(kind: str) -> NDArray[np.float64]:
    """Faces (F, 4, 3) [m] of a body of the demo, in its own frame."""
    if kind == "ball":
        polar, around = np.linspace(0.0, np.pi, 9), np.linspace(0.0, 2 * np.pi, 13)
        p, a = np.meshgrid(polar, around, indexing="ij")
        surface = 0.25 * np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1)
    elif kind == "can":
        around = np.linspace(0.0, 2 * np.pi, 17)
        rings = [(0.0, 0.2), (0.25, 0.2), (0.25, -0.2), (0.0, -0.2)]
        surface = np.array([[(r * np.cos(a), r * np.sin(a), z) for a in around] for r, z in rings])
    else:
        size = np.array((0.6, 0.4, 0.3) if kind == "box" else (1.0, 0.65, 0.3)) / 2
        corners = [(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]
        rings = [(0.0, 1.0), (1.0, 1.0), (1.0, -1.0), (0.0, -1.0)]
        surface = np.array([[(r * x, r * y, z) for x, y in corners] for r, z in rings]) * size
    quads = np.stack([surface[:-1, :-1], surface[1:, :-1], surface[1:, 1:], surface[:-1, 1:]], axis=2)
    return quads.reshape(-1, 4, 3)


def _picture(frame: Frame, path: Path) -> Path:
    """The ground, the patches and the bodies, drawn back to front in one collection."""
    x, y, z = frame.window()
    figure = plt.figure(figsize=(13, 8), dpi=110)
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    light = LightSource(315, 45)
    shade = light.shade(z, COLOURS, vert_exag=2.0, dx=frame.resolution, dy=frame.resolution, vmin=-2.0)
    grid = np.stack([*np.meshgrid(x, y), z], axis=-1)
    cells = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    faces, colours = [*cells], [*shade[:-1, :-1].reshape(-1, 4)]
    patches = frame.triangles + np.array([0.0, 0.0, 0.05])
    faces += [*np.concatenate([patches, patches[:, :1]], axis=1)]
    colours += [mpl.colors.to_rgba(PATCH_COLOUR)] * len(patches)
    for name, body in frame.bodies.items():
        kind = name.split("_")[0]
        solid = body.points(_solid(kind))
        faces += [*solid]
        colours += [*_lit(solid, BODY_COLOURS[kind])]
    edges = [(0.3, 0.15, 0.0, 1.0) if index >= len(cells) else colour for index, colour in enumerate(colours)]
    axes.add_collection3d(Poly3DCollection(faces, facecolors=colours, edgecolors=edges, linewidths=0.25))
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), zlim=(float(z.min()), float(z.max())))
    axes.set_box_aspect((2 * REACH, 2 * REACH, float(np.ptp(z))), zoom=1.5)
    axes.view_init(elev=42, azim=-60)
    axes.set_axis_off()
    for kind, colour in BODY_COLOURS.items():
        axes.plot([], [], "o", color=colour, label=kind)
    axes.plot([], [], "s", color=PATCH_COLOUR, label="patch")
    axes.legend(loc="upper left", frameon=False)
    figure.suptitle("A wave travels over a real elevation model: colliders exist under the bodies only", y=0.93)
    figure.savefig(path, bbox_inches="tight")
    plt.close(figure)
    return path


def _lit(faces: NDArray[np.float64], colour: str) -> NDArray[np.float64]:
    """Colours (F, 4) of faces lit from above."""
    normal = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    length = np.linalg.norm(normal, axis=1)
    up = np.divide(np.abs(normal[:, 2]), length, out=np.zeros_like(length), where=length > 0.0)
    shaded = np.tile(np.array(mpl.colors.to_rgba(colour)), (len(faces), 1))
    shaded[:, :3] *= (0.55 + 0.45 * up)[:, None]
    return shaded


def _plan(axes: Any, frame: Frame) -> None:
    """The frame from above."""
    x, y, z = frame.window()
    image = LightSource(315, 40).shade(
        z, plt.get_cmap("gist_earth"), vert_exag=4.0, dx=frame.resolution, dy=frame.resolution
    )
    axes.imshow(image, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), interpolation="bilinear")
    outlines = frame.triangles[:, :, :2]
    axes.add_collection(
        PolyCollection(list(outlines), facecolor=PATCH_COLOUR, edgecolor="#5b3000", linewidth=0.2, alpha=0.75)
    )
    for name, body in frame.bodies.items():
        kind = name.split("_")[0]
        axes.plot(*body.position[:2], "s" if kind in ("box", "husky") else "o", color=BODY_COLOURS.get(kind, "black"),
                  markersize=9 if kind == "husky" else 4, markeredgecolor="white", markeredgewidth=0.5)  # fmt: skip
    axes.set_title(f"{frame.time:.1f} s", fontsize=10)
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH))
    axes.set_xticks([])
    axes.set_yticks([])


def _strip(frames: list[Frame], path: Path) -> Path:
    chosen = [frames[int(index)] for index in np.linspace(0, len(frames) - 1, 6)]
    figure, grid = plt.subplots(2, 3, figsize=(12, 8.4), dpi=100, constrained_layout=True)
    for axes, frame in zip(grid.ravel(), chosen, strict=True):
        _plan(axes, frame)
    figure.savefig(path)
    plt.close(figure)
    return path


def _clip(frames: list[Frame], path: Path) -> Path:
    chosen = frames[:: math.ceil(len(frames) / 30)]
    figure, axes = plt.subplots(figsize=(5, 5), dpi=80, constrained_layout=True)

    def show(index: int) -> list[Any]:
        axes.clear()
        _plan(axes, chosen[index])
        return []

    FuncAnimation(figure, show, frames=len(chosen)).save(path, writer=PillowWriter(fps=6))
    plt.close(figure)
    return path
