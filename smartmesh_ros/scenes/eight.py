"""A wheeled robot that drives an eight on a smooth part of the elevation model: ground, way and steering."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from smartmesh_ros.scenes.moving import jacksboro_fault, resampled
from smartmesh_ros.terrain.heightmap import HeightMap

# Wheel joints of the robot, and the side of each: -1 left, 1 right.
WHEELS = {"front_left_wheel": -1.0, "rear_left_wheel": -1.0, "front_right_wheel": 1.0, "rear_right_wheel": 1.0}
RADIUS = 0.178  # of the wheels [m]
AHEAD = 1.0  # way along the eight to the point that the robot steers to [m]
SPACING = 0.03  # of the map [m]
RELIEF = 0.6  # of the elevation model, from its lowest to its highest sample [m]
PLACE = (6.0, 6.3)  # middle of the eight [m]
LOOP = 2.2  # radius of its loops [m]
SPEED = 0.9  # [m/s]


def robot_file() -> Path:
    """Return the robot's URDF, which PyBullet ships."""
    import pybullet_data

    return Path(pybullet_data.getDataPath()) / "husky" / "husky.urdf"


def ground() -> HeightMap:
    """Return a smooth part of the elevation model, on a fine grid; raises `InputError` without Matplotlib."""
    coarse = jacksboro_fault(RELIEF)[100:142, 150:202]
    fine = resampled(coarse, np.linspace(0, 41, 421), np.linspace(0, 51, 401))
    return HeightMap(fine - fine.mean(), resolution=SPACING)


def on_the_eight(way: float) -> tuple[float, float]:
    """Return the point of the eight after a ``way`` [m] from its crossing: a left circle, then a right one."""
    side = 1.0 if way % (4.0 * math.pi * LOOP) < 2.0 * math.pi * LOOP else -1.0
    angle = way / LOOP
    return PLACE[0] + LOOP * math.sin(angle), PLACE[1] + side * LOOP * (1.0 - math.cos(angle))


def steered(position: Sequence[float], orientation: Sequence[float], way: float) -> tuple[float, dict[str, float]]:
    """Return how far along the eight a robot is [m], and the speeds of its wheels [rad/s] towards the eight some way
    ahead. ``way`` [m]: how far it was before; ``orientation``: quaternion x, y, z, w."""
    x, y = position[:2]
    way = min((way + 0.02 * step for step in range(100)), key=lambda way: math.dist((x, y), on_the_eight(way)))
    tx, ty = on_the_eight(way + AHEAD)
    qx, qy, qz, qw = orientation
    heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    error = (math.atan2(ty - y, tx - x) - heading + math.pi) % (2.0 * math.pi) - math.pi
    spread = max(-0.8, min(0.8, 1.5 * error))
    return way, {joint: SPEED / RADIUS * (1.0 + side * spread) for joint, side in WHEELS.items()}
