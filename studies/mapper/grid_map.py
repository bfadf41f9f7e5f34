"""Maps as the arrays of a grid_map_msgs/GridMap, for whoever writes the message."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.mapper.mapping import MapFrame

FloatGrid = NDArray[np.float32]


class GridMapArrays(NamedTuple):
    """What a GridMap holds: ``lengths`` and ``centre`` (x, y) [m], the ``start`` of the circular buffer along -x and -y
    (`outer_start_index`, `inner_start_index`), and layers by name (along -x, along -y), as they lie in the buffer."""

    resolution: float
    lengths: tuple[float, float]
    centre: tuple[float, float]
    start: tuple[int, int]
    layers: dict[str, FloatGrid]


def grid_map_arrays(frame: MapFrame) -> GridMapArrays:
    """The layers ``elevation`` and ``variance`` of a frame.

    A cell of the lattice keeps its place in the buffer for as long as it is on the map, as grid_map scrolls.
    """
    geometry = frame.geometry
    step, (x, y, _) = geometry.resolution, geometry.origin
    last_column, last_row = round(x / step) + geometry.columns - 1, round(y / step) + geometry.rows - 1
    start = (-last_column % geometry.columns, -last_row % geometry.rows)
    return GridMapArrays(
        step,
        (geometry.columns * step, geometry.rows * step),
        (x + 0.5 * (geometry.columns - 1) * step, y + 0.5 * (geometry.rows - 1) * step),
        start,
        {
            name: np.roll(layer.T[::-1, ::-1], start, (0, 1))
            for name, layer in (("elevation", frame.elevation), ("variance", frame.variance))
        },
    )
