"""Size of a patch: room for the body, its motion until the next update, and the rounding to the nearest vertex."""

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.config import MOST_GRID_RINGS
from smartmesh_ros.terrain.grid import FloatArray, IntArray


class Extent(NamedTuple):
    """Size of N patches, arrays of shape (N,): rings around the centre and stride from ring to ring [samples]; and
    ``least`` to ``most`` [m], the range of reaches for which a patch keeps this size."""

    rings: IntArray
    stride: IntArray
    least: FloatArray
    most: FloatArray


def extent_for(
    reach: FloatArray, resolution: float, smallest_side: int, fixed_rings: int = 0, most_rings: int = MOST_GRID_RINGS
) -> Extent:
    """Return the size of patches for bodies that can touch ground within ``reach`` [m] of their centre until the next
    update.

    ``resolution`` [m] and ``smallest_side`` [samples] are the map's. ``fixed_rings`` > 0 sets the rings (the report's
    collider-size) with stride 1. A body that needs more than ``most_rings`` gets a coarser stride. A patch is never
    larger than the map.
    """
    room = (smallest_side - 1) // 2
    if fixed_rings:
        rings = np.full(reach.shape, min(fixed_rings, room))
        return Extent(rings, np.ones_like(rings), np.zeros_like(reach), np.full_like(reach, np.inf))
    # Half a cell more, because the patch is centred on the nearest vertex instead of the body.
    cells = np.clip(np.ceil(reach / resolution + 0.5 - 1e-9).astype(np.int64), 1, room)
    stride = -(-cells // most_rings)
    rings = np.maximum(np.minimum(-(-cells // stride), room // stride), 1)
    covered = rings * stride
    most = np.where(covered + stride > room, np.inf, (covered - 0.5) * resolution)
    return Extent(rings, stride, (covered - stride - 1.0) * resolution, most)
