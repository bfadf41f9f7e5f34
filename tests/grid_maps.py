"""Grid maps as their own library writes them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from grid_map_msgs.msg import GridMap
from numpy.typing import ArrayLike
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from smartmesh_ros.tools.testing import floats, pose_message


def grid_map_message(
    layers: Mapping[str, ArrayLike],
    resolution: float,
    middle: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    start: tuple[int, int] = (0, 0),
    row_major: bool = False,
    frame_id: str = "map",
    stamp: Any = None,
) -> GridMap:
    """A GridMap of layers (rows along +y, columns along +x) around ``middle`` [m].

    Cell (i, j) of space lies at the middle plus half a length, less (i + 1/2, j + 1/2) cells, and is stored at that
    place after ``start``, the first cell (along -x, along -y) of the circular buffer.
    """
    message = GridMap(layers=list(layers), outer_start_index=start[0], inner_start_index=start[1])
    message.header.frame_id = frame_id
    if stamp is not None:
        message.header.stamp = stamp
    message.info.resolution, message.info.pose = resolution, pose_message(middle)
    labels = ("row_index", "column_index") if row_major else ("column_index", "row_index")
    for values in layers.values():
        cells = np.roll(np.asarray(values, np.float32).T[::-1, ::-1], start, (0, 1))  # (along -x, along -y)
        message.info.length_x, message.info.length_y = (resolution * count for count in cells.shape)
        stored = cells if row_major else cells.T
        data = Float32MultiArray(data=floats(np.ascontiguousarray(stored)))
        data.layout.dim = [
            MultiArrayDimension(label=label, size=size, stride=stored.size)
            for label, size in zip(labels, stored.shape, strict=True)
        ]
        message.data.append(data)
    return message
