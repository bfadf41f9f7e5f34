"""Terrain messages of other stacks: each module converts one type of message to a `Raster`.

Their packages are imported on first use.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from smartmesh_ros.io.rasters import Raster, RasterConfig
from smartmesh_ros.node.inputs.adapters import grid_map, image, occupancy_grid, point_cloud


class Adapter(NamedTuple):
    """A message type by package and name, and its conversion, whose last argument is the most samples allowed."""

    package: str
    message: str
    convert: Callable[[Any, RasterConfig, int], Raster]


# Keys: values of the parameter ``terrain.input``, also the names of the topics in the node's namespace.
ADAPTERS = {
    "grid_map": Adapter("grid_map_msgs", "GridMap", grid_map.raster_from),
    "image": Adapter("sensor_msgs", "Image", image.raster_from),
    "occupancy_grid": Adapter("nav_msgs", "OccupancyGrid", occupancy_grid.raster_from),
    "point_cloud": Adapter("sensor_msgs", "PointCloud2", point_cloud.raster_from),
}
