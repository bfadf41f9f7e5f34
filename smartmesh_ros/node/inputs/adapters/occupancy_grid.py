"""nav_msgs/OccupancyGrid and its updates: occupied cells stand ``raster.scale`` metres high."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster, RasterConfig, from_cells, occupancy_heights
from smartmesh_ros.node.inputs.conversions import FloatGrid, require_cells, require_length, yaw_from


def raster_from(message: Any, config: RasterConfig, max_samples: int) -> Raster:
    """Convert a whole grid; ``info.origin`` is the outer corner of the first cell."""
    info = message.info
    if not (np.isfinite(info.resolution) and info.resolution > 0.0):
        raise InputError("geometry", f"resolution is {info.resolution} m; it must be finite and greater than zero")
    corner = info.origin.position
    return from_cells(
        occupancy_heights(_cells(message.data, info.height, info.width, max_samples), config),
        corner=(corner.x, corner.y, corner.z),
        yaw=yaw_from(info.origin.orientation),
        resolution=float(info.resolution),
    )


def region_from(message: Any, config: RasterConfig, max_samples: int) -> tuple[int, int, FloatGrid]:
    """Return first row, first column and heights [m] of a map_msgs/OccupancyGridUpdate."""
    if message.x < 0 or message.y < 0:
        raise InputError("region", f"the update starts at ({message.x}, {message.y}), outside the map")
    cells = _cells(message.data, message.height, message.width, max_samples)
    return message.y, message.x, occupancy_heights(cells, config)


def _cells(data: Any, rows: int, columns: int, max_samples: int) -> Any:
    require_cells(rows * columns, max_samples)
    require_length("the grid", len(data), rows * columns)
    return np.frombuffer(data, np.int8).reshape(rows, columns)
