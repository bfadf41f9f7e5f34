"""``make rover``: a wheeled robot drives an eight on an elevation model of soil; pictures and a GIF of its ruts."""

from __future__ import annotations

import argparse
import io
import math
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pybullet_data
from PIL import Image

from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.physics.world import World
from smartmesh_ros.scenes.elevation import jacksboro_fault
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROVER = Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"
WHEELS = {"front_left_wheel": -1.0, "rear_left_wheel": -1.0, "front_right_wheel": 1.0, "rear_right_wheel": 1.0}
RADIUS = 0.178  # of the wheels [m]
AHEAD = 1.0  # way along the eight to the point that the rover steers to [m]
SPACING = 0.03  # of the map [m]
RELIEF = 0.6  # of the map, from its lowest to its highest sample [m]
PLACE = (6.0, 6.3)  # middle of the eight [m]
LOOP = 2.2  # radius of its loops [m]
SPEED = 0.9  # [m/s]
SOIL = "hit_lss1"


def ground() -> HeightMap:
    """Return a smooth part of the elevation model, on a fine grid."""
    coarse = jacksboro_fault(RELIEF)[100:142, 150:202].astype(np.float64)
    rows, columns = np.linspace(0, 41, 421), np.linspace(0, 51, 401)
    along = np.array([np.interp(columns, np.arange(52), row) for row in coarse])
    fine = np.array([np.interp(rows, np.arange(42), column) for column in along.T]).T
    return HeightMap(fine - fine.mean(), resolution=SPACING)


def on_the_eight(way: float) -> tuple[float, float]:
    """Return the point of the eight after a ``way`` [m] from its crossing: a left circle, then a right one."""
    side = 1.0 if way % (4.0 * math.pi * LOOP) < 2.0 * math.pi * LOOP else -1.0
    angle = way / LOOP
    return PLACE[0] + LOOP * math.sin(angle), PLACE[1] + side * LOOP * (1.0 - math.cos(angle))


def drive(world: World, way: float) -> float:
    """Steer the rover towards the eight, some way ahead; return how far along the eight it is [m]."""
    state = world.state("rover")
    x, y, _ = state.position
    way = min((way + 0.02 * step for step in range(100)), key=lambda way: math.dist((x, y), on_the_eight(way)))
    tx, ty = on_the_eight(way + AHEAD)
    qx, qy, qz, qw = state.orientation
    heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    error = (math.atan2(ty - y, tx - x) - heading + math.pi) % (2.0 * math.pi) - math.pi
    spread = max(-0.8, min(0.8, 1.5 * error))
    for joint, right in WHEELS.items():
        world.drive("rover", joint, SPEED / RADIUS * (1.0 + right * spread), 60.0)
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
        world.spawn_robot("rover", str(ROVER), BodyState((*PLACE, 0.0)), on_ground=True, align=True)
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
