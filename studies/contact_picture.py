"""``make renders``: how contacts work, in one figure (docs/images/contacts.png). Contacts and curves are the core's."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from smartmesh_ros import HeightMap
from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape

OUT = Path("docs/images/contacts.png")
SPACING, RADIUS = 0.1, 0.25  # [m]
WHEEL = (0.56, 0.0, 0.283)  # middle [m]
SWING, RATE = 0.08, 4.0  # of the ground that moves [m], [rad/s]
MAPS = 0.1  # between two maps [s]
GROUND, BODY, LINE = "#8a6d3b", "#1f6fb4", "#bf4d80"


def draw_facets(axes: Axes) -> None:
    """A wheel seen from the side: samples, facets in reach, and contacts."""
    x = SPACING * np.arange(13)
    heights = 0.07 * np.cos(2.0 * np.pi * (x - 0.15) / 0.8) + 0.01 * np.cos(50.0 * x) + 0.08
    rows = 9
    terrain = HeightMap(np.tile(heights, (rows, 1)), resolution=SPACING, origin=(0.0, -0.5 * SPACING * (rows - 1)))
    pose = np.vstack([np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), WHEEL])  # its axis is y
    wheel = BodyShape.cylinder(RADIUS, 0.1)
    falls = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.0]])
    found = np.asarray(CORE.find_contacts(wheel, [terrain.core_reader], pose, falls, 1.0 / 240.0, 0.03))
    axes.plot(x, heights, "o-", color=GROUND, markersize=4, linewidth=1.0, alpha=0.5)
    reach = (x > WHEEL[0] - RADIUS - SPACING) & (x < WHEEL[0] + RADIUS + SPACING)
    axes.plot(
        x[reach], heights[reach], "o-", color=GROUND, markersize=5, linewidth=3.0, label="facets in reach: the patch"
    )
    axes.add_patch(Circle((WHEEL[0], WHEEL[2]), RADIUS, fill=False, color=BODY, linewidth=1.5))
    for px, _, pz, nx, _, nz in found[:, :6]:
        axes.annotate("", (px + 0.12 * nx, pz + 0.12 * nz), (px, pz), arrowprops={"arrowstyle": "->", "color": LINE})
        axes.plot(px, pz, "o", color=LINE, markersize=5)
    axes.plot([], [], "o-", color=LINE, markersize=5, label="contacts, with their normals")
    axes.set(xlim=(0.0, 1.2), ylim=(-0.06, 0.62), aspect="equal", xlabel="x [m]", ylabel="z [m]")
    axes.set_title("A wheel at the start of a step", fontsize=11)
    axes.legend(fontsize=8, loc="upper right")


def draw_motion(axes: Axes) -> None:
    """A sample between maps: heights of the maps, and what the core makes of them."""
    map_times = MAPS * np.arange(16)
    terrain = HeightMap(np.zeros((3, 3)), resolution=1.0)
    times, shown = np.arange(0.0, MAPS * 16, 1.0 / 240.0), []
    for time in times:
        if (due := int(time / MAPS)) > round(terrain.time / MAPS):
            terrain.replace(np.full((3, 3), SWING * np.sin(RATE * MAPS * due)), time=MAPS * due)
        shown.append(float(terrain.at([[1.0, 1.0]], time).heights[0]))
    axes.plot(times, SWING * np.sin(RATE * times), ":", color="black", linewidth=1.0, label="true ground")
    axes.plot(times, shown, color=GROUND, linewidth=1.8, label="ground at contacts: second order in time")
    axes.plot(map_times, SWING * np.sin(RATE * map_times), "o", color=LINE, markersize=6, label="maps")
    stairs = np.repeat(SWING * np.sin(RATE * map_times), 2)
    axes.plot(np.append(np.repeat(map_times, 2)[1:], MAPS * 16), stairs, color="grey", linewidth=0.8, alpha=0.7,
              label="a height field that is replaced")  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="height of a sample [m]", xlim=(0.0, MAPS * 16), ylim=(-0.09, 0.15))
    axes.set_title("A sample from map to map (at 10 Hz)", fontsize=11)
    axes.legend(fontsize=8, loc="upper right")


def main() -> None:
    """Draw both panels, and write the picture."""
    figure = Figure(figsize=(11.0, 4.0), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.2, 1.0])
    draw_facets(left)
    draw_motion(right)
    figure.savefig(OUT)
    print(OUT)
