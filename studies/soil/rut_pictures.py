"""``make rover``: a wheeled robot drives an eight on an elevation model of soil. ``make tracks``: an excavator's
undercarriage drives, turns on the spot and climbs 20 degrees on soil. Pictures and a GIF of ruts, coloured by depth."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros import BodyState, Soil, World
from smartmesh_ros.scenes import eight, tracks
from studies.running import say
from studies.tiny_renderer import Camera, Stage

OUT = Path("out")
GROUND = (0.86, 0.84, 0.80)
LIT = 175.0  # brightness of level ground in a picture
SHALLOW, DEEP = 0.0005, 0.04  # depths [m] from which ground is coloured, and at which the colours end
COLOURS = mpl.colormaps["autumn_r"]


class RutPictures:
    """Takes pictures of a ``robot`` from its file, by a ``camera``; in the world it is the body ``name``."""

    def __init__(self, robot: Path, name: str, camera: Camera) -> None:
        self.stage = Stage()
        self.name, self.camera = name, camera
        self.robot = self.stage.client.loadURDF(str(robot), (0.0, 0.0, -9.0))
        count = self.stage.client.getNumJoints(self.robot)
        names = [self.stage.client.getJointInfo(self.robot, joint)[1].decode() for joint in range(count)]
        self.joints = {name: joint for joint, name in enumerate(names)}

    def shoot(self, world: World, soil: Soil, title: str) -> Image.Image:
        """Return a picture of the robot as it stands in a world."""
        state = world.base_state(self.name)
        self.stage.client.resetBasePositionAndOrientation(self.robot, state.position, state.orientation)
        for joint in world.joints(self.name):
            self.stage.client.resetJointState(self.robot, self.joints[joint.name], joint.position)
        self.stage.replace_heights(soil.map, GROUND)
        shot = self.stage.shoot(self.camera)
        places = soil.map.geometry.to_grid(shot.points[:, :, :2].reshape(-1, 2))
        row, column = np.clip(np.rint(places).astype(int), 0, np.array(soil.map.heights.shape) - 1).T
        depth = soil.sinkage()[row, column].reshape(shot.uids.shape)
        sunk = np.isin(shot.uids, self.stage.ground) & (depth > SHALLOW)
        light = shot.colours[sunk].mean(axis=1, keepdims=True) / LIT
        shot.colours[sunk] = np.clip(255.0 * light * COLOURS(depth[sunk] / DEEP)[:, :3], 0.0, 255.0).astype(np.uint8)
        picture, width = Image.fromarray(shot.colours), self.camera.width
        write, font = ImageDraw.Draw(picture), ImageFont.load_default(size=17)
        write.text((12, 8), title, "black", font)
        bar = np.tile(255.0 * COLOURS(np.linspace(0.0, 1.0, 160))[None, :, :3], (14, 1, 1)).astype(np.uint8)
        picture.paste(Image.fromarray(bar), (width - 250, 12))
        write.text((width - 258, 8), "sinkage 0", "black", font, anchor="ra")
        write.text((width - 12, 8), f"{1e3 * DEEP:.0f} mm", "black", font, anchor="ra")
        return picture


def film(
    study: str, world: World, seconds: float, step: Callable[[int], None], every: int, shoot: Callable[[], Image.Image]
) -> None:
    """Run ``step`` with the number of each step; write a GIF with a picture of one of ``every`` steps, and the last
    picture."""
    frames = []
    for number in range(round(seconds / world.dt)):
        step(number)
        if number % every == every - 1:
            frames.append(shoot())
            say(f"{world.time:.0f} of {seconds:.0f} s")
    OUT.mkdir(exist_ok=True)
    frames[-1].save(OUT / f"{study}.png")
    frames[0].save(OUT / f"{study}.gif", save_all=True, append_images=frames[1:], duration=120, loop=0)
    print(f"\nwrote {OUT / study}.png and {OUT / study}.gif")


def drive_rover() -> None:
    """Drive the eight."""
    name = "hit_lss1"
    camera = Camera((6.3, -1.6, 4.6), (6.15, 5.6, 0.0), 35.0, 800, 420)
    with World(eight.ground()) as world:
        # The robot turns by the slip of its wheels. With slip sinkage the outer ones dig in, and it turns no more.
        soil = Soil(world.terrain, name, slip_sinkage=False)
        world.ground.set_soil(soil)
        world.spawn_robot("rover", str(eight.robot_file()), BodyState((*eight.PLACE, 0.0)), on_ground=True, align=True)
        pictures, way = RutPictures(eight.robot_file(), "rover", camera), 0.0

        def step(number: int) -> None:
            nonlocal way
            if number % 24 == 0 and world.time > 1.0:
                state = world.state("rover")
                way, speeds = eight.steered(state.position, state.orientation, way)
                for joint, speed in speeds.items():
                    world.drive("rover", joint, speed, 60.0)
            world.step()

        film("rover", world, 110.0, step, 360, lambda: pictures.shoot(world, soil, f"{world.time:.0f} s on {name}"))
        print(f"deepest rut {1e3 * soil.sinkage().max():.0f} mm, rescues {world.rescues}, lost {world.lost}")


def drive_tracks() -> None:
    """Drive the tracked machine by its plan."""
    name = "lete_sand"
    camera = Camera((1.6, -9.2, 4.2), (3.75, 0.0, 0.75), 35.0, 800, 420)
    with World(tracks.ground()) as world:
        world.ground.set_soil(soil := Soil(world.terrain, name))
        world.spawn_robot("machine", tracks.robot_file().read_text(), BodyState(), on_ground=True, align=True)
        pictures = RutPictures(tracks.robot_file(), "machine", camera)

        def step(_: int) -> None:
            for track, speed in tracks.speeds(world.time).items():
                world.drive("machine", track, speed)
            world.step()

        def shoot() -> Image.Image:
            left, right = tracks.speeds(world.time).values()
            title = f"{world.time:.0f} s on {name}, tracks {left:+.1f} and {right:+.1f} m/s"
            return pictures.shoot(world, soil, title)

        film("tracks", world, tracks.PLAN[-1][0], step, 72, shoot)
        x, _, z = world.state("machine").position
        print(f"at x = {x:.2f} m, {z:.2f} m high; deepest rut {1e3 * soil.sinkage().max():.0f} mm")
