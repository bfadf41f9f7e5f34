"""Writes a bag of a rover that drives over waves: whole maps, and the rover's odometry.

scripts/workspace run dev -- python scripts/make_bag.py out/waves --storage mcap --seconds 5
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from nav_msgs.msg import Odometry

from smartmesh_ros.node.timing.pacing import stamp_of
from smartmesh_ros.scenes.moving import InwardWaves, Wave
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.tools.testing import bags, heightmap_message, pose_message

MAP_RATE, POSE_RATE = 20, 60
SPEED = 0.5  # of the rover along x [m/s]
START = 1_700_000_000.0  # stamps in the past, like those of a recorded bag [s]
SCENE = InwardWaves(GridGeometry(rows=81, columns=101, resolution=0.1, origin=(-5.0, -4.0, 0.0)), Wave(0.2, 1.5, 3.0))


def heightmap(time: float) -> Any:
    """Return the map at ``time`` [s] after the start."""
    geometry = SCENE.geometry
    return heightmap_message(
        SCENE.heights(time), resolution=geometry.resolution, origin=geometry.origin, stamp=stamp_of(START + time)
    )


def odometry(time: float) -> Odometry:
    """Return the rover's odometry at ``time`` [s] after the start."""
    message = Odometry(child_frame_id="base_link")
    message.header.stamp, message.header.frame_id = stamp_of(START + time), "map"
    message.pose.pose = pose_message((SPEED * time - 1.0, 0.5, 0.5))
    message.twist.twist.linear.x = SPEED
    return message


def messages(seconds: float) -> Iterator[tuple[str, float, Any]]:
    """Yield (topic, time [s], message) in the order of time."""
    for tick in range(math.floor(seconds * POSE_RATE)):
        time = tick / POSE_RATE
        if tick % (POSE_RATE // MAP_RATE) == 0:
            yield "/terrain_collider/heightmap", START + time, heightmap(time)
        yield "/odom", START + time, odometry(time)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path, help="folder of the new bag")
    parser.add_argument("--storage", choices=get_args(bags.Storage), default="mcap")
    parser.add_argument("--seconds", type=float, default=5.0)
    options = parser.parse_args()
    bags.write(options.path, messages(options.seconds), options.storage)
    print(f"wrote {options.path}")


if __name__ == "__main__":
    main()
