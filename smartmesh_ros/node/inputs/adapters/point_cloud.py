"""Organised sensor_msgs/PointCloud2: rows and columns of equally spaced points."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster, RasterConfig, from_points
from smartmesh_ros.node.inputs.conversions import require_cells

# Of sensor_msgs/PointField: FLOAT32 and FLOAT64.
TYPES = {7: "f4", 8: "f8"}
AXES = ("x", "y", "z")


def raster_from(message: Any, config: RasterConfig, max_samples: int) -> Raster:
    """Convert an organised cloud; the points' x and y give the grid, their z the heights."""
    if message.height < 2 or message.width < 2:
        raise InputError(
            "not_a_grid",
            f"a cloud of {message.height} x {message.width} points is not organised in rows and columns",
        )
    require_cells(message.height * message.width, max_samples)
    if message.row_step < message.width * message.point_step or len(message.data) != message.height * message.row_step:
        raise InputError(
            "length",
            f"{len(message.data)} bytes for {message.height} rows of {message.row_step}, {message.width} points of "
            f"{message.point_step} each",
        )
    fields = {field.name: field for field in message.fields}
    points = np.empty((message.height, message.width, 3))
    for axis, name in enumerate(AXES):
        if name not in fields or fields[name].datatype not in TYPES or fields[name].count > 1:
            raise InputError(
                "fields", f"the cloud has no single field {name!r} of FLOAT32 or FLOAT64; it has {list(fields)}"
            )
        dtype = np.dtype((">" if message.is_bigendian else "<") + TYPES[fields[name].datatype])
        offset = fields[name].offset
        if offset + dtype.itemsize > message.point_step:
            raise InputError("fields", f"field {name!r} at byte {offset} leaves a point of {message.point_step} bytes")
        strides = (message.row_step, message.point_step)
        points[..., axis] = np.ndarray(points.shape[:2], dtype, message.data, offset, strides)
    return from_points(points, config)
