"""grid_map_msgs/GridMap: one layer of a robot-centric or fixed grid map."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import Raster, RasterConfig, from_grid_map
from smartmesh_ros.node.inputs.conversions import require_cells, require_length

# Largest difference of a map's length from a whole number of cells [cells].
OFF_GRID = 0.01


def raster_from(message: Any, config: RasterConfig, max_samples: int) -> Raster:
    """Convert the layer ``config.layer`` and, unless empty, ``config.variance_layer`` and ``config.friction_layer``.

    The map's orientation and z are ignored, as grid_map itself does.
    """
    info = message.info
    layers = list(message.layers)
    for name, parameter in (
        (config.layer, "raster.layer"), (config.variance_layer, "raster.variance_layer"),
        (config.friction_layer, "terrain.friction_layer"),
    ):  # fmt: skip
        if name not in layers and (name or parameter == "raster.layer"):
            raise InputError("layer", f"there is no layer {name!r}; {parameter} may be one of {', '.join(layers)}")
    require_length("the list of layers' data", len(message.data), len(message.layers))
    if not (np.isfinite(info.resolution) and info.resolution > 0.0):
        raise InputError("geometry", f"resolution is {info.resolution} m; it must be finite and greater than zero")
    along_x = _cells(info.length_x, info.resolution)
    along_y = _cells(info.length_y, info.resolution)
    require_cells(along_x * along_y, max_samples)
    variances, friction = (
        _layer(message.data[layers.index(name)], along_x, along_y) if name else None
        for name in (config.variance_layer, config.friction_layer)
    )
    return from_grid_map(
        _layer(message.data[layers.index(config.layer)], along_x, along_y),
        start=(message.outer_start_index, message.inner_start_index),
        centre=(info.pose.position.x, info.pose.position.y),
        resolution=info.resolution,
        config=config,
        variances=variances,
        friction=friction,
    )


def _cells(length: float, resolution: float) -> int:
    cells = length / resolution
    if not (0.0 < cells < 2.0**31) or abs(cells - round(cells)) > OFF_GRID:
        raise InputError("geometry", f"a length of {length} m is no whole number of cells of {resolution} m")
    return round(cells)


def _layer(data: Any, along_x: int, along_y: int) -> NDArray[np.float32]:
    """Return a layer's cells (along -x, along -y); its labels tell whether columns or rows are contiguous."""
    dims = data.layout.dim
    labels = tuple(dim.label for dim in dims)
    sizes = {"column_index": along_y, "row_index": along_x}
    if sorted(labels) != sorted(sizes):
        raise InputError("length", f"a layer's dimensions are {labels}; they must be column_index and row_index")
    for dim in dims:
        if dim.size != sizes[dim.label]:
            raise InputError(
                "length", f"{dim.label} has size {dim.size}, but the map's lengths make it {sizes[dim.label]}"
            )
    values = np.frombuffer(data.data, np.float32)
    require_length("the layer", len(values) - data.layout.data_offset, along_x * along_y)
    cells = values[data.layout.data_offset :].reshape([sizes[label] for label in labels])
    return cells if labels[0] == "row_index" else cells.T
