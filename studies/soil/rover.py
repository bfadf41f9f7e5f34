"""``make rover``: a wheeled robot drives an eight on an elevation model of soil; pictures and a GIF of its ruts."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.scenes.eight import PLACE, SPACING, ground, robot_file, steered
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.world.world import World
from studies.progress import Progress
from studies.tiny_renderer import Camera, Stage

SOIL = "hit_lss1"
CAMERA = Camera((6.3, -1.6, 4.6), (6.15, 5.6, 0.0), 35.0, 800, 420)
GROUND = (0.86, 0.84, 0.80)
LIT = 175.0  # brightness of level ground in a picture
TILE = 100  # rows of a mesh; PyBullet draws no mesh of all samples
SHALLOW, DEEP = 0.0005, 0.04  # depths [m] from which ground is coloured, and at which the colours end
COLOURS = mpl.colormaps["autumn_r"]


def drive(world: World, way: float) -> float:
    """Steer the rover towards the eight; return how far along the eight it is [m]."""
    state = world.state("rover")
    way, speeds = steered(state.position, state.orientation, way)
    for joint, speed in speeds.items():
        world.drive("rover", joint, speed, 60.0)
    return way


class RoverPictures:
    """Takes pictures of the rover on its ground, whose sunk places are coloured by their depth."""

    def __init__(self, robot: str) -> None:
        self.stage = Stage()
        self.robot = self.stage.client.loadURDF(robot, (*PLACE, -9.0))
        count = self.stage.client.getNumJoints(self.robot)
        names = [self.stage.client.getJointInfo(self.robot, joint)[1].decode() for joint in range(count)]
        self.joints = {name: joint for joint, name in enumerate(names)}

    def place(self, world: World) -> None:
        """Stand the robot as it stands in a world."""
        state = world.base_state("rover")
        self.stage.client.resetBasePositionAndOrientation(self.robot, state.position, state.orientation)
        for joint in world.joints("rover"):
            self.stage.client.resetJointState(self.robot, self.joints[joint.name], joint.position)

    def shoot(self, soil: Soil, title: str) -> Image.Image:
        """Return a picture."""
        heights = soil.map.heights.astype(np.float64)
        y, x = np.meshgrid(*(SPACING * np.arange(count) for count in heights.shape), indexing="ij")
        points = np.stack([x, y, heights], axis=-1)
        self.stage.replace_ground(
            *((points[first : first + TILE + 1], GROUND) for first in range(0, len(points) - 1, TILE))
        )
        shot = self.stage.shoot(CAMERA)
        row, column = (
            np.clip(np.rint(shot.points[:, :, axis] / SPACING).astype(int), 0, heights.shape[1 - axis] - 1)
            for axis in (1, 0)
        )
        depth = soil.sinkage()[row, column]
        sunk = np.isin(shot.uids, self.stage.ground) & (depth > SHALLOW)
        light = shot.colours[sunk].mean(axis=1, keepdims=True) / LIT
        shot.colours[sunk] = np.clip(255.0 * light * COLOURS(depth[sunk] / DEEP)[:, :3], 0.0, 255.0).astype(np.uint8)
        picture = Image.fromarray(shot.colours)
        write, font = ImageDraw.Draw(picture), ImageFont.load_default(size=17)
        write.text((12, 8), title, "black", font)
        bar = np.tile(255.0 * COLOURS(np.linspace(0.0, 1.0, 160))[None, :, :3], (14, 1, 1)).astype(np.uint8)
        picture.paste(Image.fromarray(bar), (CAMERA.width - 250, 12))
        write.text((CAMERA.width - 258, 8), "sinkage 0", "black", font, anchor="ra")
        write.text((CAMERA.width - 12, 8), f"{1e3 * DEEP:.0f} mm", "black", font, anchor="ra")
        return picture


def main() -> None:
    """Drive, and write the pictures to a folder."""
    parser = argparse.ArgumentParser(prog="python -m studies rover", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    parser.add_argument("--seconds", type=float, default=110.0, help="time to drive")
    options = parser.parse_args()
    say = Progress()
    options.out.mkdir(parents=True, exist_ok=True)
    with World(ground()) as world:
        soil = Soil(world.terrain, SOIL, BulletBodies(world.client, world), SoilConfig())
        world.spawn_robot("rover", str(robot_file()), BodyState((*PLACE, 0.0)), on_ground=True, align=True)
        pictures, way = RoverPictures(str(robot_file())), 0.0
        frames = []
        for number in range(round(options.seconds / world.dt)):
            if number % 24 == 0:
                way = drive(world, way) if world.time > 1.0 else way
            world.step()
            soil.apply(world.contacts(), world.dt, world.time)
            if number % 360 == 359:
                pictures.place(world)
                frames.append(pictures.shoot(soil, f"{world.time:.0f} s on {SOIL}"))
                say(f"{world.time:.0f} of {options.seconds:.0f} s")
        print(f"\ndeepest rut {1e3 * soil.sinkage().max():.0f} mm, rescues {world.rescues}, lost {world.lost}")
    frames[-1].save(options.out / "rover.png")
    frames[0].save(options.out / "rover.gif", save_all=True, append_images=frames[1:], duration=120, loop=0)
    print(f"wrote {options.out / 'rover.png'} and {options.out / 'rover.gif'}")


if __name__ == "__main__":
    main()
