"""Messages of ground that gives way: what bodies pressed, and how deep it lies now."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from smartmesh_msgs.msg import HeightmapUpdate
from std_msgs.msg import Float32MultiArray, Header, MultiArrayDimension

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.soil.soil import Region, Soil


def update_message(header: Header, tile: str, region: Region) -> HeightmapUpdate:
    """Return a changed rectangle as a message."""
    height, width = region.heights.shape
    return HeightmapUpdate(
        header=header, tile=tile, x=region.column, y=region.row, width=width, height=height,
        heights=floats(region.heights), velocities=floats(region.velocities),
    )  # fmt: skip


def sinkage_message(kind: Any, header: Header, soil: Soil) -> Any:
    """Return the ground as a grid map of the class ``kind``: elevation and sinkage [m].

    Cell (0, 0) of a grid map is the one farthest along +x and +y. The map's yaw is not part of a grid map.
    """
    geometry = soil.map.geometry
    message = kind(header=header)
    message.info.resolution = geometry.resolution
    message.info.length_x = geometry.columns * geometry.resolution
    message.info.length_y = geometry.rows * geometry.resolution
    middle = geometry.to_world(0.5 * (geometry.rows - 1), 0.5 * (geometry.columns - 1))
    message.info.pose.position.x, message.info.pose.position.y = middle.tolist()
    message.info.pose.orientation.w = 1.0
    layers = {"elevation": soil.map.heights + np.float32(geometry.origin[2]), "sinkage": soil.sinkage()}
    message.layers, message.basic_layers = list(layers), ["elevation"]
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
