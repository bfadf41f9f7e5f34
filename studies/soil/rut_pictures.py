"""Pictures of a robot on soil, whose sunk places are coloured by their depth."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros.soil.contact_soil import ContactSoil
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.world.world import World
from studies.tiny_renderer import Camera, Stage

GROUND = (0.86, 0.84, 0.80)
LIT = 175.0  # brightness of level ground in a picture
TILE = 100  # rows of a mesh; PyBullet draws no mesh of all samples
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

    def place(self, world: World) -> None:
        """Stand the robot as it stands in a world."""
        state = world.base_state(self.name)
        self.stage.client.resetBasePositionAndOrientation(self.robot, state.position, state.orientation)
        for joint in world.joints(self.name):
            self.stage.client.resetJointState(self.robot, self.joints[joint.name], joint.position)

    def shoot(self, soil: ContactSoil | Soil, title: str) -> Image.Image:
        """Return a picture."""
        heights, geometry = soil.map.heights.astype(np.float64), soil.map.geometry
        spacing, origin = geometry.resolution, geometry.origin
        y, x = np.meshgrid(
            *(origin[axis] + spacing * np.arange(heights.shape[1 - axis]) for axis in (1, 0)), indexing="ij"
        )
        points = np.stack([x, y, heights], axis=-1)
        self.stage.replace_ground(
            *((points[first : first + TILE + 1], GROUND) for first in range(0, len(points) - 1, TILE))
        )
        shot = self.stage.shoot(self.camera)
        row, column = (
            np.clip(
                np.rint((shot.points[:, :, axis] - origin[axis]) / spacing).astype(int), 0, heights.shape[1 - axis] - 1
            )
            for axis in (1, 0)
        )
        depth = soil.sinkage()[row, column]
        sunk = np.isin(shot.uids, self.stage.ground) & (depth > SHALLOW)
        light = shot.colours[sunk].mean(axis=1, keepdims=True) / LIT
        shot.colours[sunk] = np.clip(255.0 * light * COLOURS(depth[sunk] / DEEP)[:, :3], 0.0, 255.0).astype(np.uint8)
        return self._labelled(Image.fromarray(shot.colours), title)

    def _labelled(self, picture: Image.Image, title: str) -> Image.Image:
        """Write a title and the scale of the colours on a picture."""
        width = self.camera.width
        write, font = ImageDraw.Draw(picture), ImageFont.load_default(size=17)
        write.text((12, 8), title, "black", font)
        bar = np.tile(255.0 * COLOURS(np.linspace(0.0, 1.0, 160))[None, :, :3], (14, 1, 1)).astype(np.uint8)
        picture.paste(Image.fromarray(bar), (width - 250, 12))
        write.text((width - 258, 8), "sinkage 0", "black", font, anchor="ra")
        write.text((width - 12, 8), f"{1e3 * DEEP:.0f} mm", "black", font, anchor="ra")
        return picture
