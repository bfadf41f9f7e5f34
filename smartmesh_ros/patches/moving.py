"""Bodies on a grid, and how they move over it."""

from __future__ import annotations

from typing import NamedTuple

from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray


class Moving(NamedTuple):
    """n bodies by their index: fractional (row, column) (n, 2), positions (n, 3) [m], bounding radii (n,) [m], and how
    far they moved in the last step (n, 3) [m]."""

    bodies: IntArray
    grid: FloatArray
    positions_w: FloatArray
    radii: FloatArray
    moved_w: FloatArray

    def of(self, rows: IntArray | BoolArray) -> Moving:
        """Those in ``rows``."""
        return Moving(self.bodies[rows], self.grid[rows], self.positions_w[rows], self.radii[rows], self.moved_w[rows])
