"""Maps of soils: which of several soils lies where, from a nav_msgs/OccupancyGrid."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs.conversions import require_cells, require_length, yaw_from
from smartmesh_ros.terrain.grid import GridGeometry


class SoilMap(NamedTuple):
    """Cells (rows, columns) of a map of soils: 0 = unknown, k = the k-th soil of the list. ``x``, ``y`` [m], ``yaw``:
    pose of the outer corner of the first cell in the terrain's frame. ``resolution`` [m]: of a cell."""

    cells: NDArray[np.uint8]
    x: float
    y: float
    yaw: float
    resolution: float

    def kinds_on(self, geometry: GridGeometry) -> NDArray[np.uint8]:
        """Return the cell in which each sample of a height map lies (rows, columns); 0 beside the map."""
        kinds = np.zeros((geometry.rows, geometry.columns), np.uint8)
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        columns = np.arange(geometry.columns)
        for row in range(geometry.rows):
            x, y = (geometry.to_world(np.full(geometry.columns, row), columns) - (self.x, self.y)).T / self.resolution
            along, across = np.floor(cos * x + sin * y), np.floor(cos * y - sin * x)
            high, wide = self.cells.shape
            inside = (along >= 0) & (along < wide) & (across >= 0) & (across < high)
            kinds[row, inside] = self.cells[across[inside].astype(np.int64), along[inside].astype(np.int64)]
        return kinds


def soil_map_from(message: Any, count: int, max_cells: int) -> SoilMap:
    """Convert a message whose cells are -1 or the places of soils in a list of ``count``. Raises `InputError`."""
    info = message.info
    if not (math.isfinite(info.resolution) and info.resolution > 0.0):
        raise InputError("geometry", f"resolution is {info.resolution} m; it must be finite and greater than zero")
    corner = info.origin.position
    if not (math.isfinite(corner.x) and math.isfinite(corner.y)):
        raise InputError("geometry", f"the origin is ({corner.x}, {corner.y}) m; it must be finite")
    require_cells(info.height * info.width, max_cells)
    require_length("the grid", len(message.data), info.height * info.width)
    cells = np.frombuffer(message.data, np.int8).reshape(info.height, info.width)
    if cells.size and not -1 <= cells.min() <= cells.max() < count:
        known = (
            f"places in the parameter soils, 0 to {count - 1}" if count else "in the parameter soils, which is empty"
        )
        raise InputError(
            "soil", f"cells are {cells.min()} to {cells.max()}; they must be -1, which is unknown, or {known}"
        )
    return SoilMap((cells + 1).astype(np.uint8), corner.x, corner.y, yaw_from(info.origin.orientation), info.resolution)
