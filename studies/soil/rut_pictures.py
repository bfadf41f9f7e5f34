"""``make rover``: a wheeled robot drives an eight on an elevation model of soil. ``make tracks``: an excavator's
undercarriage drives, turns on the spot and climbs 20 degrees on soil. Pictures of ruts, coloured by depth."""

import math
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros import BodyState, HeightMap, Soil, World
from smartmesh_ros.scenes import eight, tracks
from studies.pages import ROOT, say
from studies.tiny_renderer import Camera, Stage

IMAGES = ROOT / "docs" / "images"
GROUND = (0.86, 0.84, 0.80)
LIT = 175.0  # brightness of level ground in a picture
SHALLOW, DEEP = 0.0005, 0.04  # depths [m] from which ground is coloured, and at which the colours end
COLOURS = mpl.colormaps["autumn_r"]


def draw(path: Path, world: World, soil: Soil, robot: Path, camera: Camera, title: str) -> None:
    """Write a picture of a world's only body, a ``robot`` by its file, and of the ruts in its soil."""
    stage, [name] = Stage(), world.bodies
    stage.add_robot(world, name, str(robot))
    stage.replace_heights(soil.map, GROUND)
    shot = stage.shoot(camera)
    places = soil.map.geometry.to_grid(shot.points[:, :, :2].reshape(-1, 2))
    row, column = np.clip(np.rint(places).astype(int), 0, np.array(soil.map.heights.shape) - 1).T
    depth = soil.sinkage()[row, column].reshape(shot.uids.shape)
    sunk = np.isin(shot.uids, stage.ground) & (depth > SHALLOW)
    light = shot.colours[sunk].mean(axis=1, keepdims=True) / LIT
    shot.colours[sunk] = np.clip(255.0 * light * COLOURS(depth[sunk] / DEEP)[:, :3], 0.0, 255.0).astype(np.uint8)
    picture = Image.fromarray(shot.colours)
    write, font = ImageDraw.Draw(picture), ImageFont.load_default(size=17)
    write.text((12, 8), title, "black", font)
    bar = np.tile(255.0 * COLOURS(np.linspace(0.0, 1.0, 160))[None, :, :3], (14, 1, 1)).astype(np.uint8)
    picture.paste(Image.fromarray(bar), (camera.width - 250, 12))
    write.text((camera.width - 258, 8), "sinkage 0", "black", font, anchor="ra")
    write.text((camera.width - 12, 8), f"{1e3 * DEEP:.0f} mm", "black", font, anchor="ra")
    picture.save(path)
    print(f"\nwrote {path}; deepest rut {1e3 * soil.sinkage().max():.0f} mm")


def run(world: World, steps: int, act: Callable[[int], None]) -> None:
    """Step a world; ``act`` is called with the number of each step before it."""
    for number in range(steps):
        act(number)
        world.step()
        if number % 240 == 0:
            say(f"{world.time:.0f} of {steps * world.dt:.0f} s")


def drive_rover() -> None:
    """Drive the eight."""
    name, way = "hit_lss1", 0.0
    with World(eight.ground()) as world:
        # The robot turns by the slip of its wheels. With slip sinkage the outer ones dig in, and it turns no more.
        soil = Soil(world.terrain, name, slip_sinkage=False)
        world.ground.set_soil(soil)
        world.spawn_robot("rover", str(eight.robot_file()), BodyState((*eight.PLACE, 0.0)), on_ground=True, align=True)

        def act(number: int) -> None:
            nonlocal way
            if number % 24 == 0 and world.time > 1.0:
                state = world.state("rover")
                way, speeds = eight.steered(state.position, state.orientation, way)
                for joint, speed in speeds.items():
                    world.drive("rover", joint, speed, 60.0)

        run(world, round(109.5 / world.dt), act)
        camera = Camera((6.3, -1.6, 4.6), (6.15, 5.6, 0.0), 35.0, 800, 420)
        draw(IMAGES / "soil" / "rover.png", world, soil, eight.robot_file(), camera, f"{world.time:.0f} s on {name}")


# The ground that the tracked machine climbs, on a slope of 20 degrees.
SPACING = 0.04  # of the map [m]
ORIGIN = (-2.0, -2.6)  # first sample of the map [m]; the machine starts at x = y = 0
SIZE = (11.2, 5.2)  # of the map [m]
SLOPE = math.radians(20.0)
FOOT, RAMP, TOP = 3.0, 4.5, 7.3  # where the ground begins to rise, is as steep as the ramp, and becomes level [m]
FLATTENING = 1.0  # way on which it becomes level [m]
# Until when [s], and the speeds [m/s] of the left and right track: stand, drive, turn once on the spot, climb.
PLAN = ((1.0, 0.0, 0.0), (4.0, 0.5, 0.5), (15.1, -0.4, 0.4), (25.5, 0.5, 0.5))


def ramp() -> HeightMap:
    """Return level ground with the ramp, which rises along x."""
    x = ORIGIN[0] + SPACING * np.arange(round(SIZE[0] / SPACING) + 1)
    begins = np.clip((x - FOOT) / (RAMP - FOOT), 0.0, 1.0)
    ends = np.clip((TOP + FLATTENING - x) / FLATTENING, 0.0, 1.0)
    heights = np.cumsum(math.tan(SLOPE) * begins * ends) * SPACING
    return HeightMap(np.tile(heights, (round(SIZE[1] / SPACING) + 1, 1)), resolution=SPACING, origin=ORIGIN)


def track_speeds(time: float) -> dict[str, float]:
    """Return the speeds of the tracks [m/s] at a ``time`` [s]."""
    left, right = next((tracks for until, *tracks in PLAN if time < until), (0.0, 0.0))
    return {"left_track": left, "right_track": right}


def drive_tracks() -> None:
    """Drive the tracked machine by its plan."""
    name = "lete_sand"
    with World(ramp()) as world:
        world.ground.set_soil(soil := Soil(world.terrain, name))
        world.spawn_robot("machine", tracks.robot_file().read_text(), BodyState(), on_ground=True, align=True)

        def act(_: int) -> None:
            for track, speed in track_speeds(world.time).items():
                world.drive("machine", track, speed)

        run(world, round(PLAN[-1][0] / world.dt), act)
        left, right = track_speeds(world.time).values()
        title = f"{world.time:.0f} s on {name}, tracks {left:+.1f} and {right:+.1f} m/s"
        camera = Camera((1.6, -9.2, 4.2), (3.75, 0.0, 0.75), 35.0, 800, 420)
        draw(IMAGES / "tracks.png", world, soil, tracks.robot_file(), camera, title)
