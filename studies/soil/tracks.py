"""``make tracks``: an excavator's undercarriage drives, turns on the spot and climbs 20 degrees on soil; pictures and a
GIF of its ruts."""

from __future__ import annotations

import argparse
from pathlib import Path

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.scenes.tracks import PLAN, ground, robot_file, speeds
from smartmesh_ros.soil.bodies import BulletBodies
from smartmesh_ros.soil.config import SoilConfig
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.world.world import World
from studies.progress import Progress
from studies.soil.rut_pictures import RutPictures
from studies.tiny_renderer import Camera

SOIL = "lete_sand"
CAMERA = Camera((1.6, -9.2, 4.2), (3.75, 0.0, 0.75), 35.0, 800, 420)
FRAMES = 72  # steps between pictures


def main() -> None:
    """Drive, and write the pictures to a folder."""
    parser = argparse.ArgumentParser(prog="python -m studies tracks", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    parser.add_argument("--seconds", type=float, default=PLAN[-1][0], help="time to drive")
    options = parser.parse_args()
    say = Progress()
    options.out.mkdir(parents=True, exist_ok=True)
    with World(ground()) as world:
        soil = Soil(world.terrain, SOIL, BulletBodies(world.client, world), SoilConfig())
        world.spawn_robot("machine", robot_file().read_text(), BodyState(), on_ground=True, align=True)
        pictures, frames = RutPictures(robot_file(), "machine", CAMERA), []
        for number in range(round(options.seconds / world.dt)):
            for track, speed in speeds(world.time).items():
                world.drive("machine", track, speed)
            world.step()
            soil.apply(world.contacts(), world.dt, world.time)
            if number % FRAMES == FRAMES - 1:
                pictures.place(world)
                left, right = speeds(world.time).values()
                title = f"{world.time:.0f} s on {SOIL}, tracks {left:+.1f} and {right:+.1f} m/s"
                frames.append(pictures.shoot(soil, title))
                say(f"{world.time:.0f} of {options.seconds:.0f} s")
        x, _, z = world.state("machine").position
        print(f"\nat x = {x:.2f} m, {z:.2f} m high; deepest rut {1e3 * soil.sinkage().max():.0f} mm")
    frames[-1].save(options.out / "tracks.png")
    frames[0].save(options.out / "tracks.gif", save_all=True, append_images=frames[1:], duration=120, loop=0)
    print(f"wrote {options.out / 'tracks.png'} and {options.out / 'tracks.gif'}")


if __name__ == "__main__":
    main()
