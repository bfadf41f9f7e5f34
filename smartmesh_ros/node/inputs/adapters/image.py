"""sensor_msgs/Image: pixels as heights, placed and scaled by the parameters ``raster.*``."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster, RasterConfig, from_image
from smartmesh_ros.node.inputs.conversions import require_cells

ENCODINGS = {"32FC1": "f4", "16UC1": "u2", "mono16": "u2", "mono8": "u1", "8UC1": "u1"}


def raster_from(message: Any, config: RasterConfig, max_samples: int) -> Raster:
    """Convert an image; pixels of a 32FC1 image that are not finite become holes."""
    if message.encoding not in ENCODINGS:
        raise InputError(
            "encoding", f"encoding {message.encoding!r} holds no heights; use one of {', '.join(ENCODINGS)}"
        )
    require_cells(message.height * message.width, max_samples)
    dtype = np.dtype((">" if message.is_bigendian else "<") + ENCODINGS[message.encoding])
    if message.step < message.width * dtype.itemsize:
        raise InputError("length", f"{message.step} bytes a row cannot hold {message.width} pixels of {dtype.itemsize}")
    if len(message.data) != message.height * message.step:
        raise InputError(
            "length",
            f"{len(message.data)} bytes for {message.height} rows; there must be {message.step} for each",
        )
    shape, strides = (message.height, message.width), (message.step, dtype.itemsize)
    return from_image(np.ndarray(shape, dtype, message.data, strides=strides), config)
