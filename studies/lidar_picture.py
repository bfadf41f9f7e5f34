"""``make renders``: what a lidar on a robot measures of the ground, drawn over the ground; docs/images/lidar.png."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pybullet as pb
from PIL import Image, ImageDraw, ImageFont

from smartmesh_ros import BodyState, Box, HeightMap, World
from smartmesh_ros.scenes.eight import ground, robot_file
from studies.tiny_renderer import Camera, Stage

OUT = Path("docs/images/lidar.png")
CAMERA = Camera((0.9, 0.2, 4.0), (6.2, 6.6, -0.3), 36.0, 800, 420)
GROUND, PLUM = (0.86, 0.84, 0.80), (0.75, 0.30, 0.50)
ROBOT, ABOVE = (6.0, 6.3), 0.6  # place of the robot, and of the lidar above its root link [m]
BOXES = ((8.2, 7.6), (7.2, 4.4), (4.6, 8.4))
HALF = (0.35, 0.35, 0.4)  # half sides of the boxes [m]
BEAMS = np.radians(np.linspace(-25.0, 5.0, 16))
STEPS, RANGE = 720, 12.0
HIDDEN = 0.25  # distance between a point and what its pixel shows from which something is before the point [m]


def main() -> None:
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
        turn, beam = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, STEPS, endpoint=False), BEAMS)
        x, y, z = np.cos(beam) * np.cos(turn), np.cos(beam) * np.sin(turn), np.sin(beam)
        rays = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        hits = world.cast_rays(np.tile(eye, (len(rays), 1)), rays, RANGE, through=("husky",))
        for number in range(len(BOXES)):
            state = world.state(f"box_{number}")
            uid = stage.add(pb.GEOM_BOX, PLUM, halfExtents=HALF)
            stage.client.resetBasePositionAndOrientation(uid, state.position, state.orientation)
        stage.add_robot(world, "husky", str(robot_file()))
    stage.replace_heights(terrain, GROUND)
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
    picture.save(OUT)
    print(f"{met.sum()} of {len(rays)} rays met the ground or a box; wrote {OUT}")
