"""Pictures of the pages that need no browser. ``make friction``: boxes slide on ice beside gravel; ``make renders``:
how contacts work, with contacts and curves of the core, and what a lidar on a robot measures of the ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pybullet as pb
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros import BodyState, Box, HeightMap, PhysicsConfig, World, WorldConfig
from smartmesh_ros.core import CORE
from smartmesh_ros.scenes.eight import ground, robot_file
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import GRAVITY
from studies.tiny_renderer import Camera, Stage

FRICTION = Path("docs/images/friction.png")
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


def draw_friction() -> None:
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
    for kind, factor in GROUND.items():
        mu = factor * BODY
        right.plot(v, v**2 / (2.0 * mu * GRAVITY), color=LINES[kind], linewidth=1.2)
        stopped = [found[kind, speed][-1, 0] for speed in SPEEDS]
        right.plot(SPEEDS, stopped, "o", color=LINES[kind], label=f"{kind}: {factor:g} x {BODY:g} = {mu:.2g}")
        for speed, way in zip(SPEEDS, stopped, strict=True):
            expected = speed**2 / (2.0 * mu * GRAVITY)
            print(f"{kind}, {speed:g} m/s: {way:.3f} m, v^2 / (2 mu g) = {expected:.3f} m, {way / expected - 1:+.2%}")
    right.set(xlabel="speed at the start [m/s]", ylabel="way until the box stops [m]", xlim=(0, 4.3), ylim=(0, 9.5))
    right.set_title("points: simulated; lines: v² / (2 µ g)", fontsize=11)
    right.legend(frameon=False, loc="upper left")
    right.spines[["top", "right"]].set_visible(False)
    figure.savefig(FRICTION)
    print(f"wrote {FRICTION}, {FRICTION.stat().st_size / 1e3:.0f} kB")


CONTACTS = Path("docs/images/contacts.png")
CELL, WHEEL_RADIUS = 0.1, 0.25  # [m]
WHEEL = (0.56, 0.0, 0.283)  # middle [m]
SWING, RATE = 0.08, 4.0  # of the ground that moves [m], [rad/s]
MAPS = 0.1  # between two maps [s]
LAND, WHEEL_LINE, NORMALS = "#8a6d3b", "#1f6fb4", "#bf4d80"


def draw_facets(axes: Axes) -> None:
    """A wheel seen from the side: samples, facets in reach, and contacts."""
    x = CELL * np.arange(13)
    heights = 0.07 * np.cos(2.0 * np.pi * (x - 0.15) / 0.8) + 0.01 * np.cos(50.0 * x) + 0.08
    rows = 9
    terrain = HeightMap(np.tile(heights, (rows, 1)), resolution=CELL, origin=(0.0, -0.5 * CELL * (rows - 1)))
    pose = np.vstack([np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), WHEEL])  # its axis is y
    wheel = CORE.Shape.cylinder(WHEEL_RADIUS, 0.05)
    falls = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.0]])
    found = np.asarray(CORE.find_contacts(wheel, [terrain.core_reader], pose, falls, 1.0 / 240.0, 0.03))
    axes.plot(x, heights, "o-", color=LAND, markersize=4, linewidth=1.0, alpha=0.5)
    reach = (x > WHEEL[0] - WHEEL_RADIUS - CELL) & (x < WHEEL[0] + WHEEL_RADIUS + CELL)
    axes.plot(
        x[reach], heights[reach], "o-", color=LAND, markersize=5, linewidth=3.0, label="facets in reach: the patch"
    )
    axes.add_patch(Circle((WHEEL[0], WHEEL[2]), WHEEL_RADIUS, fill=False, color=WHEEL_LINE, linewidth=1.5))
    for px, _, pz, nx, _, nz in found[:, :6]:
        axes.annotate("", (px + 0.12 * nx, pz + 0.12 * nz), (px, pz), arrowprops={"arrowstyle": "->", "color": NORMALS})
        axes.plot(px, pz, "o", color=NORMALS, markersize=5)
    axes.plot([], [], "o-", color=NORMALS, markersize=5, label="contacts, with their normals")
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
    axes.plot(times, shown, color=LAND, linewidth=1.8, label="ground at contacts: second order in time")
    axes.plot(map_times, SWING * np.sin(RATE * map_times), "o", color=NORMALS, markersize=6, label="maps")
    stairs = np.repeat(SWING * np.sin(RATE * map_times), 2)
    axes.plot(np.append(np.repeat(map_times, 2)[1:], MAPS * 16), stairs, color="grey", linewidth=0.8, alpha=0.7,
              label="a height field that is replaced")  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="height of a sample [m]", xlim=(0.0, MAPS * 16), ylim=(-0.09, 0.15))
    axes.set_title("A sample from map to map (at 10 Hz)", fontsize=11)
    axes.legend(fontsize=8, loc="upper right")


def draw_contacts() -> None:
    """Draw both panels, and write the picture."""
    figure = Figure(figsize=(11.0, 4.0), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.2, 1.0])
    draw_facets(left)
    draw_motion(right)
    CONTACTS.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(CONTACTS)
    print(CONTACTS)


LIDAR = Path("docs/images/lidar.png")
CAMERA = Camera((0.9, 0.2, 4.0), (6.2, 6.6, -0.3), 36.0, 800, 420)
SOIL, BOX_COLOUR = (0.86, 0.84, 0.80), (0.75, 0.30, 0.50)
ROBOT, ABOVE = (6.0, 6.3), 0.6  # place of the robot, and of the lidar above its root link [m]
BOXES = ((8.2, 7.6), (7.2, 4.4), (4.6, 8.4))
HALF = (0.35, 0.35, 0.4)  # half sides of the boxes [m]
BEAMS = np.radians(np.linspace(-25.0, 5.0, 16))
TURNS, RANGE = 720, 12.0
HIDDEN = 0.25  # distance between a point and what its pixel shows from which something is before the point [m]


def draw_lidar() -> None:
    """Look once around, and write the picture."""
    terrain: HeightMap = ground()
    stage = Stage()
    with World(terrain) as world:
        world.spawn_robot("husky", str(robot_file()), BodyState((*ROBOT, 0.0)), on_ground=True, align=True)
        for number, place in enumerate(BOXES):
            sides = tuple(2.0 * half for half in HALF)
            world.spawn(f"box_{number}", Box(*sides), 20.0, BodyState((*place, 0.0)), on_ground=True, align=True)
        world.step(240)
        eye = np.array(world.base_state("husky").position) + (0.0, 0.0, ABOVE)
        turn, beam = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, TURNS, endpoint=False), BEAMS)
        x, y, z = np.cos(beam) * np.cos(turn), np.cos(beam) * np.sin(turn), np.sin(beam)
        rays = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        hits = world.cast_rays(np.tile(eye, (len(rays), 1)), rays, RANGE, through=("husky",))
        for number in range(len(BOXES)):
            state = world.state(f"box_{number}")
            uid = stage.add(pb.GEOM_BOX, BOX_COLOUR, halfExtents=HALF)
            stage.client.resetBasePositionAndOrientation(uid, state.position, state.orientation)
        state = world.base_state("husky")
        robot = stage.client.loadURDF(str(robot_file()))
        stage.client.resetBasePositionAndOrientation(robot, state.position, state.orientation)
    stage.replace_heights(terrain, SOIL)
    shot = stage.shoot(CAMERA)
    picture = Image.fromarray(shot.colours)
    write = ImageDraw.Draw(picture)
    met = np.isfinite(hits.distances)
    places = eye + rays[met] * hits.distances[met, None]
    for place, (column, row), distance in zip(places, CAMERA.pixels(places), hits.distances[met], strict=True):
        if not (0 <= column < CAMERA.width - 1 and 0 <= row < CAMERA.height - 1):
            continue
        if np.linalg.norm(shot.points[round(row), round(column)] - place) < HIDDEN:
            colour = tuple(int(255.0 * part) for part in mpl.colormaps["turbo"](distance / RANGE)[:3])
            write.rectangle((column - 1, row - 1, column, row), fill=colour)
    write.text((12, 8), "terrain_sensor: a lidar of 16 beams on a husky", "black", ImageFont.load_default(size=17))
    picture.save(LIDAR)
    print(f"{met.sum()} of {len(rays)} rays met the ground or a box; wrote {LIDAR}")
