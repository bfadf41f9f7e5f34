"""Patches as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchBatch:
    """Patches of n bodies with the same triangles.

    ``slots``: of the bodies (n,). ``triangles``: corners (T, 3) as indices into the K vertices of a patch.
    ``vertices_w`` (n, K, 3) [m]: z is NaN at holes. ``centres_w`` (n, 3) [m]: the nearest vertex. ``shape``: rows and
    columns of the vertices; (0, 0) on a general mesh. ``feet_w`` (n, 3) [m]: the ground under the bodies' middles, on a
    general mesh the nearest vertices. ``linear_w`` [m/s], ``angular_w`` [rad/s]: mean velocity and angular velocity of
    the ground there until the next refresh (n, 3).
    """

    slots: IntArray
    triangles: NDArray[np.int32]
    vertices_w: FloatArray
    centres_w: FloatArray
    shape: tuple[int, int]
    feet_w: FloatArray
    linear_w: FloatArray
    angular_w: FloatArray
