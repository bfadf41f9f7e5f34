"""A legged robot on ground that moves: prints what its policy would observe, and draws the points of its height scan.

scripts/workspace run -- python scripts/height_scan.py [picture]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
import pybullet_data
from PIL import Image
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import BodyState, HeightMap, HeightScan, World
from smartmesh_ros.terrain.height_scan import yaws_of
from smartmesh_ros.world.joints import JointCommand

ROBOT = f"{pybullet_data.getDataPath()}/a1/a1.urdf"
# Positions of a standing robot's joints by a part of their names [rad]; height of its base above the ground [m].
POSTURE, HEIGHT = {"upper": 0.8, "lower": -1.6}, 0.33
RESOLUTION, SIDE = 0.05, 81
# Size of the picture, how much finer it is drawn, and the radius of its points [m].
PIXELS, FINER, RADIUS = (1000, 640), 2, 0.012
GROUND_COLOURS, POINT_COLOUR = ((0.80, 0.78, 0.72, 1.0), (0.72, 0.69, 0.62, 1.0)), (0.85, 0.1, 0.1, 1.0)
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
    """Draw ground, robot and the points of a scan of heights by PyBullet's renderer."""
    client: Any = BulletClient(pb.DIRECT)
    low = -RESOLUTION * (SIDE // 2)
    rows, columns = np.divmod(np.arange((SIDE - 1) ** 2), SIDE - 1)
    corners = np.array([(0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0)])  # of both triangles of a cell: row, column
    xy = low + RESOLUTION * (np.stack([columns, rows], axis=-1)[:, None] + corners[:, ::-1])
    cells = np.concatenate([xy, world.ground_at(xy.reshape(-1, 2)).z.reshape(-1, 6, 1)], axis=-1)
    for odd, colour in enumerate(GROUND_COLOURS):  # squares of two colours
        vertices = cells[(rows // SQUARE + columns // SQUARE) % 2 == odd].reshape(-1, 3, 3)
        normals = np.cross(vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0])
        normals = np.repeat(normals / np.linalg.norm(normals, axis=-1, keepdims=True), 3, axis=0)
        surface = client.createVisualShape(
            pb.GEOM_MESH, vertices=vertices.reshape(-1, 3).tolist(), indices=list(range(3 * len(vertices))),
            normals=normals.tolist(), rgbaColor=colour,
        )  # fmt: skip
        client.createMultiBody(0.0, -1, surface)
    base = world.base_state("robot")
    yaw = float(yaws_of([base.orientation])[0])
    x, y = scan.points_b.T
    point = client.createVisualShape(pb.GEOM_SPHERE, radius=RADIUS, rgbaColor=POINT_COLOUR)
    for u, v, z in zip(x, y, world.height_scan("robot", scan)[0], strict=True):
        place = (
            base.position[0] + u * np.cos(yaw) - v * np.sin(yaw),
            base.position[1] + u * np.sin(yaw) + v * np.cos(yaw),
        )
        client.createMultiBody(0.0, -1, point, (*place, float(z)))
    robot = client.loadURDF(ROBOT, useFixedBase=True)
    client.resetBasePositionAndOrientation(
        robot, *world.client.getBasePositionAndOrientation(world.bodies["robot"].uid)
    )
    for joint in world.bodies["robot"].joints.values():
        client.resetJointState(robot, joint, world.client.getJointState(world.bodies["robot"].uid, joint)[0])
    width, height = (FINER * size for size in PIXELS)
    view = client.computeViewMatrix((1.6, -1.5, 1.25), (0.1, 0.12, 0.02), (0.0, 0.0, 1.0))
    lens = client.computeProjectionMatrixFOV(36.0, width / height, 0.1, 10.0)
    drawn = client.getCameraImage(
        width,
        height,
        view,
        lens,
        lightDirection=(2.0, -1.0, 2.0),
        lightAmbientCoeff=0.55,
        lightDiffuseCoeff=0.5,
        lightSpecularCoeff=0.0,
        shadow=0,
        renderer=pb.ER_TINY_RENDERER,
    )
    client.disconnect()
    pixels = np.asarray(drawn[2], np.uint8).reshape(height, width, 4)[..., :3]
    return Image.fromarray(pixels).resize(PIXELS, Image.Resampling.LANCZOS)


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
