"""``make rover``: a wheeled robot drives an eight on an elevation model of soil; pictures and a GIF of its ruts."""

from __future__ import annotations

import argparse
from pathlib import Path

from smartmesh_ros.ground.state import BodyState
from smartmesh_ros.scenes.eight import PLACE, ground, robot_file, steered
from smartmesh_ros.soil.contact_soil import ContactSoil
from smartmesh_ros.world.world import World
from studies.progress import Progress
from studies.soil.rut_pictures import RutPictures
from studies.tiny_renderer import Camera

SOIL = "hit_lss1"
CAMERA = Camera((6.3, -1.6, 4.6), (6.15, 5.6, 0.0), 35.0, 800, 420)


def drive(world: World, way: float) -> float:
    """Steer the rover towards the eight; return how far along the eight it is [m]."""
    state = world.state("rover")
    way, speeds = steered(state.position, state.orientation, way)
    for joint, speed in speeds.items():
        world.drive("rover", joint, speed, 60.0)
    return way


def main() -> None:
    """Drive, and write the pictures to a folder."""
    parser = argparse.ArgumentParser(prog="python -m studies rover", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    parser.add_argument("--seconds", type=float, default=110.0, help="time to drive")
    options = parser.parse_args()
    say = Progress()
    options.out.mkdir(parents=True, exist_ok=True)
    with World(ground()) as world:
        # The robot turns by the slip of its wheels. With slip sinkage the outer ones dig in, and it turns no more.
        soil = ContactSoil(world.terrain, SOIL, slip_sinkage=False)
        world.ground.set_soil(soil)
        world.spawn_robot("rover", str(robot_file()), BodyState((*PLACE, 0.0)), on_ground=True, align=True)
        pictures, way = RutPictures(robot_file(), "rover", CAMERA), 0.0
        frames = []
        for number in range(round(options.seconds / world.dt)):
            if number % 24 == 0:
                way = drive(world, way) if world.time > 1.0 else way
            world.step()
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
