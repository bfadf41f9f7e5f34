"""Grid maps, as grid_map lays them out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from std_msgs.msg import Float32MultiArray, Header, MultiArrayDimension

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.terrain.grid import GridGeometry


def grid_map_message(kind: Any, header: Header, grid: GridGeometry, layers: Mapping[str, ArrayLike]) -> Any:
    """Return ``layers`` (rows, columns) of a grid as a grid map of the class ``kind``; its basic layer is the first.

    Cell (0, 0) of a grid map is the one farthest along +x and +y. The grid's yaw is not part of a grid map.
    """
    message = kind(header=header)
    message.info.resolution = grid.resolution
    message.info.length_x, message.info.length_y = grid.columns * grid.resolution, grid.rows * grid.resolution
    middle = grid.to_world(0.5 * (grid.rows - 1), 0.5 * (grid.columns - 1))
    message.info.pose.position.x, message.info.pose.position.y = middle.tolist()
    message.info.pose.orientation.w = 1.0
    message.layers, message.basic_layers = [*layers], [next(iter(layers))]
    message.data = [_layer(values) for values in layers.values()]
    return message


def _layer(values: ArrayLike) -> Float32MultiArray:
    cells = np.asarray(values, np.float32).T[::-1, ::-1]  # rows along -x, columns along -y
    along_x, along_y = cells.shape
    message = Float32MultiArray(data=floats(cells.T))
    message.layout.dim = [
        MultiArrayDimension(label="column_index", size=along_y, stride=along_x * along_y),
        MultiArrayDimension(label="row_index", size=along_x, stride=along_x),
    ]
    return message
