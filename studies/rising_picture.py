"""``make renders``: the README's moving picture. The same bodies on a height field that is replaced at each map, and on
``smartmesh_ros``; how deep the deepest body is below the true ground is measured and written on it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as pb
from PIL import Image, ImageDraw, ImageFont
from pybullet_utils.bullet_client import BulletClient

from smartmesh_ros import Ground, HeightMap
from smartmesh_ros.terrain.grid import FloatArray
from studies.pages import say
from studies.tiny_renderer import Camera, Stage

STEPS, MAPS = 240, 60  # rates of physics and of the maps [Hz]
RISE, SPEED = 0.3, 4.0  # amplitude [m] and angular frequency [rad/s] of the ground
SPACING, COLUMNS, ROWS = 0.1, 101, 41  # of the map, which reaches from -5 to 5 m and from -2 to 2 m
SAMPLES = -5.0 + SPACING * np.arange(COLUMNS)  # x [m]
FALL, SHOWN = 2.0, 2.0 * np.pi / SPEED  # time until the bodies lie on the ground, and a period of the wave [s]
FRAMES = 40  # pictures in a second of the simulation
HALF = 0.25  # radius of balls, and half the side of boxes [m]
PLACES = (-3.2, -1.6, 0.0, 1.6, 3.2)  # x of ball, box, ball, box, ball [m]
At = Callable[[float], Any]  # does something at a time [s]


def height(x: Any, time: float) -> FloatArray:
    """Return the height [m] of the true ground at ``x`` [m] and ``time`` [s]: hollows for the bodies, lifted by a wave,
    and straight between the samples of a map."""
    heights = -0.05 * np.cos(2.0 * np.pi * SAMPLES / 1.6) + RISE * np.sin(SPEED * time - 0.4 * SAMPLES)
    return np.asarray(np.interp(x, SAMPLES, heights))


def grid(time: float) -> FloatArray:
    """Return the map of an instant (rows, columns) [m]."""
    return np.tile(height(SAMPLES, time), (ROWS, 1))


def replaced(client: Any, _: list[int]) -> tuple[At, At]:
    """PyBullet's own height field of the whole map, replaced as in PyBullet's example ``heightfield.py``."""
    layout = {"numHeightfieldRows": COLUMNS, "numHeightfieldColumns": ROWS}
    # PyBullet keeps the bounds and the middle of the first heights, so these reach as far down as up.
    heights = np.zeros(ROWS * COLUMNS)
    heights[0], heights[-1] = -2.0, 2.0
    field = client.createCollisionShape(
        pb.GEOM_HEIGHTFIELD, meshScale=[SPACING, SPACING, 1.0], heightfieldData=heights.tolist(), **layout
    )
    client.createMultiBody(0.0, field)

    def take(time: float) -> None:
        data = grid(time).ravel().tolist()
        client.createCollisionShape(pb.GEOM_HEIGHTFIELD, heightfieldData=data, replaceHeightfieldIndex=field, **layout)

    return take, lambda _: client.stepSimulation()


def ours(client: Any, bodies: list[int]) -> tuple[At, At]:
    """Contacts straight from the map."""
    terrain = HeightMap(grid(0.0), resolution=SPACING, origin=(-5.0, -2.0))
    ground = Ground(client, terrain)
    for body in bodies:
        ground.attach(body)
    return lambda time: terrain.replace(grid(time), time=time), lambda time: ground.step(time=time, dt=1.0 / STEPS)


# Each takes a client and its bodies, and returns what takes in the map of a time, and what makes a step.
WAYS = {"PyBullet: height field replaced at each map": replaced, "smartmesh_ros": ours}


def simulated(way: str) -> Iterator[tuple[float, list[tuple[Any, Any]], FloatArray]]:
    """Yield for each picture its time [s], the poses of the bodies, and their depths (5,) below the ground [m]."""
    client = BulletClient(pb.DIRECT)
    client.setGravity(0.0, 0.0, -9.81)
    shapes = (
        client.createCollisionShape(pb.GEOM_SPHERE, radius=HALF),
        client.createCollisionShape(pb.GEOM_BOX, halfExtents=[HALF] * 3),
    )
    bodies = [
        client.createMultiBody(1.0, shapes[number % 2], basePosition=(x, 0.0, height(x, 0.0) + 0.4))
        for number, x in enumerate(PLACES)
    ]
    for body in bodies:  # a sleeping body does not notice that the ground moves
        client.changeDynamics(body, -1, activationState=pb.ACTIVATION_STATE_DISABLE_SLEEPING)
    take, step = WAYS[way](client, bodies)
    for number in range(round(STEPS * (FALL + SHOWN))):
        time = number / STEPS
        if number % (STEPS // MAPS) == 0:
            take(time)
        step(time)
        after = time + 1.0 / STEPS
        if after > FALL and number % (STEPS // FRAMES) == 0:
            poses = [client.getBasePositionAndOrientation(body) for body in bodies]
            yield after, poses, np.array([depth(index % 2, pose, after) for index, pose in enumerate(poses)])
    client.disconnect()


def depth(box: int, pose: tuple[Any, Any], time: float) -> float:
    """Return how far the deepest point of a body's surface is below the ground [m], 0 at least."""
    directions = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    if not box:
        turns = np.linspace(-0.6, 0.6, 121)
        directions = np.stack([np.sin(turns), 0.0 * turns, -np.cos(turns)], axis=1)
    turn = np.reshape(pb.getMatrixFromQuaternion(pose[1]), (3, 3)) if box else np.eye(3)
    points = np.array(pose[0]) + HALF * directions @ turn.T
    return max(0.0, float(np.max(height(points[:, 0], time) - points[:, 2])))


SAND, CUT = (0.80, 0.72, 0.58), (0.45, 0.36, 0.28)
BLUE, PLUM = (0.20, 0.42, 0.80), (0.75, 0.30, 0.50)
CAMERA = Camera((0.0, -13.0, 3.2), (0.0, 0.0, 0.12), 10.8, 800, 224)
DEEP, RED = 0.005, (190, 30, 30)  # depths above this [m] are written in red
OUT = Path("docs/images/rising.gif")


def surfaces(time: float) -> tuple[tuple[FloatArray, Any], ...]:
    """Return the ground behind the bodies' middles, and the cut through it there."""
    x = np.linspace(-4.1, 4.1, 165)
    top = height(x, time)
    behind = np.stack([np.stack([x, np.full_like(x, y), top], axis=1) for y in (0.0, 1.0, 2.0)])
    cut = np.stack([np.stack([x, np.zeros_like(x), z], axis=1) for z in (np.full_like(x, -0.75), top)])
    return (behind, SAND), (cut, CUT)


def main() -> None:
    """Run both simulations, and write the pictures."""
    stage, font = Stage(), ImageFont.load_default(size=19)
    drawn = [
        stage.add(pb.GEOM_BOX, PLUM, halfExtents=[HALF] * 3) if box else stage.add(pb.GEOM_SPHERE, BLUE, radius=HALF)
        for box in (False, True, False, True, False)
    ]
    deepest = dict.fromkeys(WAYS, 0.0)
    pictures = []
    for both in zip(*map(simulated, WAYS), strict=True):
        picture = Image.new("RGB", (CAMERA.width, len(WAYS) * CAMERA.height), "white")
        for row, (way, (time, poses, depths)) in enumerate(zip(WAYS, both, strict=True)):
            stage.replace_ground(*surfaces(time))
            for body, pose in zip(drawn, poses, strict=True):
                stage.client.resetBasePositionAndOrientation(body, *pose)
            strip = Image.fromarray(stage.shoot(CAMERA).colours)
            deep, write = float(depths.max()), ImageDraw.Draw(strip)
            write.text((12, 4), way, "black", font)
            words = f"deepest body: {1e3 * deep:.0f} mm below ground"
            write.text((CAMERA.width - 12, 4), words, RED if deep > DEEP else "black", font, anchor="ra")
            picture.paste(strip, (0, row * CAMERA.height))
            deepest[way] = max(deepest[way], deep)
        pictures.append(picture.quantize(64, dither=Image.Dither.NONE))
        say(f"{len(pictures)} pictures of {round(FRAMES * SHOWN)}")
    stage.client.disconnect()
    pictures[0].save(OUT, save_all=True, append_images=pictures[1:], duration=50, loop=0, optimize=True)
    for way, most in deepest.items():
        print(f"\n{way}: at most {1e3 * most:.1f} mm below the ground", end="")
    print(f"\nwrote {OUT}, {OUT.stat().st_size / 1e6:.1f} MB")
