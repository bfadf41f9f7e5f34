"""``make rover``: a wheeled robot drives an eight on an elevation model of soil; pictures and a GIF of its ruts."""

from __future__ import annotations

import argparse
import io
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from PIL import Image

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.scenes.eight import PLACE, SPACING, ground, robot_file, steered
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.world.world import World

matplotlib.use("Agg")
import matplotlib.pyplot as plt

SOIL = "hit_lss1"


def drive(world: World, way: float) -> float:
    """Steer the rover towards the eight; return how far along the eight it is [m]."""
    state = world.state("rover")
    way, speeds = steered(state.position, state.orientation, way)
    for joint, speed in speeds.items():
        world.drive("rover", joint, speed, 60.0)
    return way


def shaded(heights: FloatArray) -> FloatArray:
    """Return the brightness (rows, columns) of ground lit from the north-west."""
    dy, dx = np.gradient(heights, SPACING)
    light = (0.5 * dx - 0.5 * dy + 0.7) / np.sqrt(1.0 + dx**2 + dy**2)
    return np.asarray(np.clip(0.2 + 0.8 * light, 0.0, 1.0))


def frame(soil: Soil, track: list[tuple[float, float]], title: str) -> Any:
    """Return a picture of the ground and its sinkage from above."""
    heights = soil.map.heights.astype(np.float64)
    extent = (0.0, (heights.shape[1] - 1) * SPACING, 0.0, (heights.shape[0] - 1) * SPACING)
    figure, axis = plt.subplots(figsize=(6.0, 6.4))
    axis.imshow(shaded(heights), cmap="gray", origin="lower", extent=extent, vmin=0.0, vmax=1.0)
    sunk = 1e3 * soil.sinkage()
    shown = axis.imshow(
        np.ma.masked_less(sunk, 0.5), cmap="autumn_r", origin="lower", extent=extent, alpha=0.75, vmin=0.0, vmax=40.0
    )
    figure.colorbar(shown, ax=axis, label="sinkage [mm]", shrink=0.8)
    if track:
        axis.plot(*np.array(track).T, color="tab:blue", lw=0.8)
        axis.plot(*track[-1], "o", color="tab:blue")
    axis.set(xlabel="x [m]", ylabel="y [m]", title=title, xlim=(1.5, 10.5), ylim=(0.6, 12.0))
    figure.tight_layout()
    content = io.BytesIO()
    figure.savefig(content, dpi=80)
    plt.close(figure)
    return Image.open(content).convert("RGB")


def main() -> None:
    """Drive, and write the pictures to a folder."""
    parser = argparse.ArgumentParser(prog="python -m studies rover", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    parser.add_argument("--seconds", type=float, default=110.0, help="time to drive")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with World(ground()) as world:
        soil = Soil(world.terrain, SOIL, BulletBodies(world.client, world), SoilConfig())
        before = frame(soil, [], "before")
        world.spawn_robot("rover", str(robot_file()), BodyState((*PLACE, 0.0)), on_ground=True, align=True)
        track: list[tuple[float, float]] = []
        way = 0.0
        frames = [before]
        for number in range(round(options.seconds / world.dt)):
            if number % 24 == 0:
                way = drive(world, way) if world.time > 1.0 else way
                x, y, _ = world.state("rover").position
                track.append((x, y))
            world.step()
            soil.apply(world.contacts(), world.dt, world.time)
            if number % 360 == 359:
                frames.append(frame(soil, track, f"{world.time:.0f} s on {SOIL}"))
        after = frame(soil, track, f"after {world.time:.0f} s")
        print(f"deepest rut {1e3 * soil.sinkage().max():.0f} mm, rescues {world.rescues}, lost {world.lost}")
    pair = Image.new("RGB", (before.width + after.width, before.height))
    pair.paste(before, (0, 0))
    pair.paste(after, (before.width, 0))
    pair.save(options.out / "rover.png")
    frames[0].save(options.out / "rover.gif", save_all=True, append_images=frames[1:], duration=120, loop=0)
    print(f"wrote {options.out / 'rover.png'} and {options.out / 'rover.gif'}")


if __name__ == "__main__":
    main()
