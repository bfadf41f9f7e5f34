"""``make friction``: boxes slide on ice beside gravel; docs/images/friction.png shows how far."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from smartmesh_ros import BodyState, Box, HeightMap, PhysicsConfig, World, WorldConfig
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import GRAVITY

OUT = Path("docs/images/friction.png")
SPACING, LENGTH, WIDTH = 0.1, 101, 41  # of the map; samples along x and along y
BODY = 0.5  # coefficient of the boxes
GROUND = {"ice": 0.2, "gravel": 1.4}  # coefficients of the ground, by which that of the boxes is multiplied
COLOURS = {"ice": "#b2d6f5", "gravel": "#cca880"}
LINES = {"ice": "#1f6fb4", "gravel": "#5a3210"}
BOX, PLUM = Box(0.36, 0.36, 0.12), "#bf4d80"
SPEEDS = (1.0, 2.0, 3.0, 4.0)  # at the start [m/s]
LANES = {"ice": (0.3, 0.76, 1.22, 1.68), "gravel": (-0.3, -0.76, -1.22, -1.68)}  # y of the boxes [m]
STEPS = 1200


def terrain() -> HeightMap:
    """Return level ground, ice where y > 0 and gravel elsewhere."""
    y = SPACING * (np.arange(WIDTH) - WIDTH // 2)
    friction = np.where(y > 0.0, GROUND["ice"], GROUND["gravel"])[:, None] * np.ones(LENGTH)
    return HeightMap(np.zeros(friction.shape), resolution=SPACING, origin=(-1.0, float(y[0])), friction=friction)


def ways() -> dict[tuple[str, float], FloatArray]:
    """Return the place of each box (steps, 3) [m], by its ground and its speed at the start."""
    found: dict[tuple[str, float], list[Any]] = {(kind, speed): [] for kind in LANES for speed in SPEEDS}
    with World(terrain(), WorldConfig(physics=PhysicsConfig(friction=BODY))) as world:
        for kind, speed in found:
            start = BodyState((0.0, LANES[kind][SPEEDS.index(speed)], 0.5 * BOX.z), linear=(speed, 0.0, 0.0))
            world.spawn(f"{kind} {speed:g}", BOX, 1.0, start)
        for _ in range(STEPS):
            for (kind, speed), places in found.items():
                places.append(world.state(f"{kind} {speed:g}").position)
            world.step()
    return {key: np.array(places) for key, places in found.items()}


def main() -> None:
    """Run the boxes, and write the picture."""
    found = ways()
    figure = Figure(figsize=(11.0, 3.7), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.75, 1.0])
    for kind, side in (("ice", (0.0, 2.0)), ("gravel", (-2.0, 0.0))):
        left.axhspan(*side, color=COLOURS[kind])
    for (kind, speed), places in found.items():
        left.plot(*places[:, :2].T, color=LINES[kind], linewidth=2.0)
        x, y, _ = places[-1].tolist()
        left.add_patch(Rectangle((x - 0.5 * BOX.x, y - 0.5 * BOX.y), BOX.x, BOX.y, facecolor=PLUM, zorder=3))
        left.annotate(f"{speed:g} m/s", places[0, :2], xytext=(-12, 0), textcoords="offset points", ha="right",
                      va="center", fontsize=9)  # fmt: skip
    left.set(xlim=(-1.0, 9.0), ylim=(-2.0, 2.0), aspect="equal")
    left.set_axis_off()
    left.set_title("ice (0.2) beside gravel (1.4) from above, and the ways of boxes with friction 0.5", fontsize=11)
    v = np.linspace(0.0, 4.3, 100)
    for kind, ground in GROUND.items():
        mu = ground * BODY
        right.plot(v, v**2 / (2.0 * mu * GRAVITY), color=LINES[kind], linewidth=1.2)
        stopped = [found[kind, speed][-1, 0] for speed in SPEEDS]
        right.plot(SPEEDS, stopped, "o", color=LINES[kind], label=f"{kind}: {ground:g} x {BODY:g} = {mu:.2g}")
        for speed, way in zip(SPEEDS, stopped, strict=True):
            expected = speed**2 / (2.0 * mu * GRAVITY)
            print(f"{kind}, {speed:g} m/s: {way:.3f} m, v^2 / (2 mu g) = {expected:.3f} m, {way / expected - 1:+.2%}")
    right.set(xlabel="speed at the start [m/s]", ylabel="way until the box stops [m]", xlim=(0, 4.3), ylim=(0, 9.5))
    right.set_title("points: simulated; lines: v² / (2 µ g)", fontsize=11)
    right.legend(frameon=False, loc="upper left")
    right.spines[["top", "right"]].set_visible(False)
    figure.savefig(OUT)
    print(f"wrote {OUT}, {OUT.stat().st_size / 1e3:.0f} kB")
