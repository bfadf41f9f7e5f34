"""Writes a bag of a rover's odometry and elevation maps: grid maps with variances, and a loop closure halfway.

scripts/workspace run dev -- python scripts/make_mapper_bag.py tests/data/mapper

Needs grid_map_msgs, installed or built for the tests.
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
from builtin_interfaces.msg import Time
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from smartmesh_ros.tools.testing import bags, floats, pose_message
from studies.mapper import DriftConfig, MapFrame, MapperConfig, MappingConfig, mapped_terrain
from studies.mapper.grid_map import grid_map_arrays

START = 1_700_000_000.0  # stamps in the past, like those of a recorded bag [s]
CELLS, RATE = 40, 5.0  # a small map and a slow one [Hz], to keep the bag small


def drive(seconds: float, seed: int) -> MappingConfig:
    """Return a drive of ``seconds`` [s] with a loop closure halfway, and a minute's drift in these few seconds."""
    return MappingConfig(
        duration=seconds,
        rate=RATE,
        seed=seed,
        mapper=MapperConfig(cells=CELLS),
        drift=DriftConfig(horizontal=0.02, vertical=0.03, yaw=0.002, closures=(0.5 * seconds,)),
    )


def stamp(time: float) -> Time:
    nanoseconds = round((START + time) * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def grid_map(frame: MapFrame) -> GridMap:
    """Return the message of an elevation mapper for a frame."""
    arrays = grid_map_arrays(frame)
    message = GridMap(layers=list(arrays.layers), basic_layers=["elevation"])
    message.header.stamp, message.header.frame_id = stamp(frame.stamp), "map"
    message.info.resolution = arrays.resolution
    message.info.length_x, message.info.length_y = arrays.lengths
    message.info.pose = pose_message((*arrays.centre, 0.0))
    message.data = [layer(cells) for cells in arrays.layers.values()]
    message.outer_start_index, message.inner_start_index = arrays.start
    return message


def layer(cells: NDArray[np.float32]) -> Float32MultiArray:
    """Return cells (along -x, along -y) as a layer stored column by column."""
    rows, columns = cells.shape
    message = Float32MultiArray(data=floats(cells.T))
    message.layout.dim = [
        MultiArrayDimension(label="column_index", size=columns, stride=rows * columns),
        MultiArrayDimension(label="row_index", size=rows, stride=rows),
    ]
    return message


def odometry(frame: MapFrame) -> Odometry:
    """Return the rover's estimated pose, without a velocity."""
    message = Odometry(child_frame_id="base_link")
    message.header.stamp, message.header.frame_id = stamp(frame.stamp), "map"
    message.pose.pose = pose_message(frame.estimate[:3])
    roll, pitch, yaw = (0.5 * angle for angle in frame.estimate[3:])
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    q = message.pose.pose.orientation
    q.w, q.x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    q.y, q.z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    return message


def messages(config: MappingConfig) -> Iterator[tuple[str, float, Any]]:
    """Yield (topic, time [s], message) in the order of time."""
    for frame in mapped_terrain(config):
        yield "/elevation_map", START + frame.stamp, grid_map(frame)
        yield "/odom", START + frame.stamp, odometry(frame)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path, help="folder of the new bag")
    parser.add_argument("--storage", choices=get_args(bags.Storage), default="mcap")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    bags.write(options.path, messages(drive(options.seconds, options.seed)), options.storage)
    print(f"wrote {options.path}")


if __name__ == "__main__":
    main()
