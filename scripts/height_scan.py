"""A legged robot on ground that moves: prints what its policy would observe, and draws the points of its height scan.

scripts/workspace run -- python -m scripts.height_scan [picture]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pybullet as pb
import pybullet_data
from PIL import Image

from smartmesh_ros import BodyState, HeightMap, HeightScan, World
from smartmesh_ros.terrain.height_scan import yaws_of
from smartmesh_ros.world.joints import JointCommand
from studies.tiny_renderer import Camera, Stage

ROBOT = f"{pybullet_data.getDataPath()}/a1/a1.urdf"
# Positions of a standing robot's joints by a part of their names [rad]; height of its base above the ground [m].
POSTURE, HEIGHT = {"upper": 0.8, "lower": -1.6}, 0.33
RESOLUTION, SIDE = 0.05, 81
# Size of the picture, how much finer it is drawn, and the radius of its points [m].
PIXELS, FINER, RADIUS = (1000, 640), 2, 0.012
GROUND_COLOURS, POINT_COLOUR = ((0.80, 0.78, 0.72), (0.72, 0.69, 0.62)), (0.85, 0.1, 0.1)
SQUARE = 4  # side of the squares by which the ground is coloured [cells]


def heights(time: float) -> np.ndarray:
    """Heights (rows, columns) [m] of a wave that travels along x at 0.2 m/s, over steps across y."""
    x = RESOLUTION * (np.arange(SIDE) - SIDE // 2)
    return 0.05 * np.sin(3.0 * (x[None] - 0.2 * time)) + 0.03 * np.floor(x[:, None] / 0.35)


def stand(world: World, ground: HeightMap) -> None:
    """Let the robot stand on the moving ground for a second."""
    state = BodyState((0.0, 0.15, heights(0.0)[SIDE // 2 + 3, SIDE // 2] + HEIGHT), (0.0, 0.0, 0.2588, 0.9659))
    world.spawn_robot("robot", ROBOT, state)
    robot = world.bodies["robot"]
    for name, joint in robot.joints.items():
        angle = next((angle for part, angle in POSTURE.items() if part in name), 0.0)
        world.client.resetJointState(robot.uid, joint, angle)
        world.command("robot", name, JointCommand(position=angle))
    for step in range(1, 241):
        if step % 8 == 0:
            ground.replace(heights(world.time), time=world.time)
        world.step()


def picture(world: World, scan: HeightScan) -> Image.Image:
    """Draw ground, robot and the points of a scan of heights."""
    stage = Stage()
    y, x = np.mgrid[:SIDE, :SIDE] * RESOLUTION - RESOLUTION * (SIDE // 2)
    ground = np.stack([x, y, world.ground_at(np.stack([x, y], axis=-1).reshape(-1, 2)).z.reshape(x.shape)], axis=-1)
    squares = [(row, column) for row in range(0, SIDE - 1, SQUARE) for column in range(0, SIDE - 1, SQUARE)]
    stage.replace_ground(
        *((ground[r : r + SQUARE + 1, c : c + SQUARE + 1], GROUND_COLOURS[(r + c) // SQUARE % 2]) for r, c in squares)
    )
    base = world.base_state("robot")
    yaw = float(yaws_of([base.orientation])[0])
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    for place, z in zip(scan.points_b @ turn.T + base.position[:2], world.height_scan("robot", scan)[0], strict=True):
        point = stage.add(pb.GEOM_SPHERE, POINT_COLOUR, radius=RADIUS)
        stage.client.resetBasePositionAndOrientation(point, (*place, z), (0.0, 0.0, 0.0, 1.0))
    stage.add_robot(world, "robot", ROBOT)
    shot = stage.shoot(Camera((1.6, -1.5, 1.25), (0.1, 0.12, 0.02), 36.0, *(FINER * size for size in PIXELS)))
    return Image.fromarray(shot.colours).resize(PIXELS, Image.Resampling.LANCZOS)


def main() -> None:
    """Print the observation and write the picture."""
    path = Path(sys.argv[1] if sys.argv[1:] else "out/height_scan.png")
    ground = HeightMap(heights(0.0), resolution=RESOLUTION, origin=(-RESOLUTION * (SIDE // 2),) * 2)
    with World(ground) as world:
        stand(world, ground)
        scan = HeightScan.of("isaac_lab")
        (slow, rows), (fast, columns) = scan.layout
        print(f"height scan of Isaac Lab's layout, a row for each {slow}, {fast} from left to right:")
        with np.printoptions(precision=2, suppress=True, linewidth=200):
            print(world.height_scan("robot", scan).reshape(rows, columns))
        path.parent.mkdir(parents=True, exist_ok=True)
        picture(world, HeightScan()).save(path)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
