"""Terrain as other stacks publish it: each module turns one kind of message into a `Raster`.

Their message packages are imported only when asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from smartmesh_ros.io.rasters import Raster, RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map, image, occupancy_grid, point_cloud


class Adapter(NamedTuple):
    """A message type by its package and name, and its conversion, which takes the most samples allowed."""

    package: str
    message: str
    convert: Callable[[Any, RasterConfig, int], Raster]


# By the value of the parameter ``terrain.input``, which is also the topic's name below the node.
ADAPTERS = {
    "grid_map": Adapter("grid_map_msgs", "GridMap", grid_map.raster_from),
    "image": Adapter("sensor_msgs", "Image", image.raster_from),
    "occupancy_grid": Adapter("nav_msgs", "OccupancyGrid", occupancy_grid.raster_from),
    "point_cloud": Adapter("sensor_msgs", "PointCloud2", point_cloud.raster_from),
}
