"""Bodies on a grid, and how they move over it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray


def reach_of(radii: FloatArray, moved_w: FloatArray) -> FloatArray:
    """How far from where they are bodies with bounding ``radii`` (n,) [m] get that move on by ``moved_w`` (n, 3) [m]:
    (n,) [m]."""
    reach: FloatArray = radii + np.sqrt(np.einsum("ij,ij->i", moved_w, moved_w))
    return reach


class Moving(NamedTuple):
    """n bodies by their index: fractional (row, column) (n, 2), positions (n, 3) [m], bounding radii (n,) [m], and how
    far they move until the next update (n, 3) [m]."""

    bodies: IntArray
    grid: FloatArray
    positions_w: FloatArray
    radii: FloatArray
    moved_w: FloatArray

    def of(self, rows: IntArray | BoolArray) -> Moving:
        """Those in ``rows``."""
        return Moving(self.bodies[rows], self.grid[rows], self.positions_w[rows], self.radii[rows], self.moved_w[rows])

    @property
    def reach(self) -> FloatArray:
        """How far from where they are they get (n,) [m]."""
        return reach_of(self.radii, self.moved_w)
