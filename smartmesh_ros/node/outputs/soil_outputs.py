"""Messages of ground that gives way: what bodies pressed, and how deep it lies now."""

from __future__ import annotations

from typing import Any

import numpy as np
from smartmesh_msgs.msg import HeightmapUpdate
from std_msgs.msg import Header

from smartmesh_ros.node.outputs.cdr import floats
from smartmesh_ros.node.outputs.grid_maps import grid_map_message
from smartmesh_ros.soil.soil import Soil
from smartmesh_ros.terrain.grid import Region


def update_message(header: Header, tile: str, region: Region) -> HeightmapUpdate:
    """Return a changed rectangle as a message."""
    height, width = region.heights.shape
    return HeightmapUpdate(
        header=header, tile=tile, x=region.column, y=region.row, width=width, height=height,
        heights=floats(region.heights), velocities=floats(np.zeros_like(region.heights)),
    )  # fmt: skip


def sinkage_message(kind: Any, header: Header, soil: Soil) -> Any:
    """Return the ground as a grid map of the class ``kind``: elevation and sinkage [m]."""
    grid = soil.map.geometry
    elevation = soil.map.heights + np.float32(grid.origin[2])
    return grid_map_message(kind, header, grid, {"elevation": elevation, "sinkage": soil.sinkage()})
