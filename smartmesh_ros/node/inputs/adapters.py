"""Terrain messages of other stacks, each converted to a `Raster`. Their packages are imported on first use."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import (
    Raster,
    RasterConfig,
    from_cells,
    from_grid_map,
    from_image,
    from_points,
    occupancy_heights,
)
from smartmesh_ros.node.inputs.cdr_reader import FloatGrid, require_cells, yaw_from
from smartmesh_ros.terrain.material import Material

# Types of pixels by encoding of an image.
ENCODINGS = {"32FC1": "f4", "16UC1": "u2", "mono16": "u2", "mono8": "u1", "8UC1": "u1"}
# Types of the fields of a point cloud: FLOAT32 and FLOAT64 of sensor_msgs/PointField.
TYPES = {7: "f4", 8: "f8"}


def require_length(what: str, actual: int, wanted: int) -> None:
    """Raise `InputError` if the length of the data does not match the sizes."""
    if actual != wanted:
        raise InputError("length", f"{what} has {actual} values; its sizes say {wanted}")


def grid_map_raster(message: Any, config: RasterConfig, group: str = "raster.") -> Raster:
    """Convert a grid_map_msgs/GridMap: the layer ``config.layer`` and, unless empty, ``config.variance_layer``, and
    those of the material, ``config.layers``. ``group``: of the parameters that name them.

    The map's orientation and z are ignored, as grid_map itself does.
    """
    info = message.info
    layers = list(message.layers)
    named = [(config.layer, "layer"), (config.variance_layer, "variance_layer")]
    for name, parameter in (*named, *((name, "material_layers") for name in config.layers.values())):
        if name not in layers and (name or parameter == "layer"):
            known = f"{group}{parameter} may be one of {', '.join(layers)}" if layers else "the map has no layers"
            raise InputError("layer", f"there is no layer {name!r}; {known}")
    require_length("the list of layers' data", len(message.data), len(message.layers))
    along_x = _cells_of(info.length_x, info.resolution)
    along_y = _cells_of(info.length_y, info.resolution)
    require_cells(along_x * along_y)

    def cells(name: str) -> NDArray[np.float32]:
        return _layer(message.data[layers.index(name)], along_x, along_y)

    return from_grid_map(
        cells(config.layer),
        start=(message.outer_start_index, message.inner_start_index),
        centre=(info.pose.position.x, info.pose.position.y),
        resolution=info.resolution,
        config=config,
        variances=cells(config.variance_layer) if config.variance_layer else None,
        material=Material(**{name: cells(layer) for name, layer in config.layers.items()}),
    )


def _cells_of(length: float, resolution: float) -> int:
    """Return the number of cells of a length [m], rounded as grid_map does; its layers have as many."""
    cells = length / resolution if resolution > 0.0 else math.nan
    if not 0.5 <= cells < 2.0**31:
        raise InputError("geometry", f"a length of {length} m is no number of cells of {resolution} m")
    return math.floor(cells + 0.5)


def _layer(data: Any, along_x: int, along_y: int) -> NDArray[np.float32]:
    """Return a layer's cells (along -x, along -y); its labels tell whether columns or rows are contiguous."""
    dims = data.layout.dim
    labels = tuple(dim.label for dim in dims)
    sizes = {"column_index": along_y, "row_index": along_x}
    if sorted(labels) != sorted(sizes):
        raise InputError("length", f"a layer's dimensions are {labels}; they must be column_index and row_index")
    for dim in dims:
        if dim.size != sizes[dim.label]:
            words = f"{dim.label} has size {dim.size}, but the map's lengths make it {sizes[dim.label]}"
            raise InputError("length", words)
    values = np.frombuffer(data.data, np.float32)
    require_length("the layer", len(values) - data.layout.data_offset, along_x * along_y)
    cells = values[data.layout.data_offset :].reshape([sizes[label] for label in labels])
    return cells if labels[0] == "row_index" else cells.T


def image_raster(message: Any, config: RasterConfig) -> Raster:
    """Convert a sensor_msgs/Image: its pixels are heights, placed and scaled by the parameters ``raster.*``. Those of a
    32FC1 image that are not finite become holes."""
    if message.encoding not in ENCODINGS:
        words = f"encoding {message.encoding!r} holds no heights; use one of {', '.join(ENCODINGS)}"
        raise InputError("encoding", words)
    require_cells(message.height * message.width)
    dtype = np.dtype((">" if message.is_bigendian else "<") + ENCODINGS[message.encoding])
    if message.step < message.width * dtype.itemsize:
        raise InputError("length", f"{message.step} bytes a row cannot hold {message.width} pixels of {dtype.itemsize}")
    if len(message.data) != message.height * message.step:
        words = f"{len(message.data)} bytes for {message.height} rows; there must be {message.step} for each"
        raise InputError("length", words)
    shape, strides = (message.height, message.width), (message.step, dtype.itemsize)
    return from_image(np.ndarray(shape, dtype, message.data, strides=strides), config)


def occupancy_raster(message: Any, config: RasterConfig) -> Raster:
    """Convert a nav_msgs/OccupancyGrid: occupied cells stand ``raster.scale`` metres high. ``info.origin`` is the outer
    corner of the first cell."""
    info = message.info
    corner, turn = info.origin.position, info.origin.orientation
    return from_cells(
        occupancy_heights(_cells(message.data, info.height, info.width), config),
        corner=(corner.x, corner.y, corner.z),
        yaw=yaw_from(turn.x, turn.y, turn.z, turn.w),
        resolution=float(info.resolution),
    )


def occupancy_region(message: Any, config: RasterConfig) -> tuple[int, int, FloatGrid]:
    """Return first row, first column and heights [m] of a map_msgs/OccupancyGridUpdate."""
    cells = _cells(message.data, message.height, message.width)
    return message.y, message.x, occupancy_heights(cells, config)


def _cells(data: Any, rows: int, columns: int) -> Any:
    require_cells(rows * columns)
    require_length("the grid", len(data), rows * columns)
    return np.frombuffer(data, np.int8).reshape(rows, columns)


def cloud_raster(message: Any, config: RasterConfig) -> Raster:
    """Convert an organised sensor_msgs/PointCloud2, which has rows and columns of equally spaced points: their x and y
    give the grid, their z the heights."""
    if message.height < 2 or message.width < 2:
        words = f"a cloud of {message.height} x {message.width} points is not organised"
        right = "it must have the rows and columns of a grid; a mapper makes a grid map of the points of a lidar"
        raise InputError("not_a_grid", f"{words}: {right}")
    require_cells(message.height * message.width)
    if message.row_step < message.width * message.point_step or len(message.data) != message.height * message.row_step:
        sizes = f"{message.height} rows of {message.row_step}, {message.width} points of {message.point_step} each"
        raise InputError("length", f"{len(message.data)} bytes for {sizes}")
    fields = {field.name: field for field in message.fields}
    points = np.empty((message.height, message.width, 3))
    for axis, name in enumerate("xyz"):
        if name not in fields or fields[name].datatype not in TYPES or fields[name].count > 1:
            words = f"the cloud has no single field {name!r} of FLOAT32 or FLOAT64; it has {list(fields)}"
            raise InputError("fields", words)
        dtype = np.dtype((">" if message.is_bigendian else "<") + TYPES[fields[name].datatype])
        offset = fields[name].offset
        if offset + dtype.itemsize > message.point_step:
            raise InputError("fields", f"field {name!r} at byte {offset} leaves a point of {message.point_step} bytes")
        strides = (message.row_step, message.point_step)
        points[..., axis] = np.ndarray(points.shape[:2], dtype, message.data, offset, strides)
    return from_points(points, config)


# Types of messages, and their conversions, by the values of the parameter ``terrain.input``, which are also the names
# of the topics in the node's namespace.
ADAPTERS: dict[str, tuple[str, Callable[[Any, RasterConfig], Raster]]] = {
    "grid_map": ("grid_map_msgs/msg/GridMap", grid_map_raster),
    "image": ("sensor_msgs/msg/Image", image_raster),
    "occupancy_grid": ("nav_msgs/msg/OccupancyGrid", occupancy_raster),
    "point_cloud": ("sensor_msgs/msg/PointCloud2", cloud_raster),
}
