"""PyBullet heightfields of patches, replaced in place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet as pb

from smartmesh_ros.terrain.grid import FloatArray

# Depth of holes below a field's base [m].
HOLE = 100.0
# Heights that differ by less count as equal [m].
SAME_HEIGHT = 1e-6
# Slope that a field's bounds allow, from its middle to its edges.
STEEPEST = 2.0


@dataclass(eq=False)
class Field:
    """A field of ``rows`` x ``columns`` samples, ``spacing`` [m] apart: its PyBullet ``shape``, ``uid`` of its body,
    the ``heights`` above its base (rows, columns) [m], and its coefficient of ``friction``."""

    rows: int
    columns: int
    spacing: float
    shape: int
    uid: int
    heights: FloatArray
    friction: float = 1.0

    def fits(self, rows: int, columns: int, spacing: float) -> bool:
        """Return True if the field has these sizes, which PyBullet cannot change."""
        return (self.rows, self.columns) == (rows, columns) and abs(self.spacing - spacing) <= 1e-9 * spacing

    def replace(self, client: Any, heights: FloatArray) -> bool:
        """Replace the heights above the base (rows, columns) [m]; returns False if they are the same already."""
        if np.allclose(heights, self.heights, rtol=0.0, atol=SAME_HEIGHT, equal_nan=True):
            return False
        client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD, heightfieldData=in_order(heights), numHeightfieldRows=self.rows,
            numHeightfieldColumns=self.columns, replaceHeightfieldIndex=self.shape,
        )  # fmt: skip
        self.heights = heights
        return True


def in_order(heights: FloatArray) -> list[float]:
    """Return heights (rows, columns) in PyBullet's order.

    The shape is rotated by 90 degrees from its grid, because PyBullet splits cells along the other diagonal than the
    main mesh, and the rotation makes the two agree (row r, column c of the patch is PyBullet's row columns - 1 - c,
    column r). PyBullet's first index runs along its x axis, although the argument is called columns.
    """
    order: list[float] = np.where(np.isnan(heights), -HOLE, heights)[:, ::-1].T.ravel().tolist()
    return order


def quarter_turn(yaw: float) -> tuple[float, float, float, float]:
    """Orientation (x, y, z, w) of the body of a field over a grid with a ``yaw`` [rad]: 90 degrees more, see
    `in_order`."""
    half = 0.5 * (yaw + 0.5 * math.pi)
    return 0.0, 0.0, math.sin(half), math.cos(half)


def make_field(client: Any, rows: int, columns: int, spacing: float, bound: float | None = None) -> Field:
    """Create a field and its body; its heights may differ by ``bound`` [m] from its base, by default by what its size
    allows at `STEEPEST`. The body is a multibody, because contacts ignore the velocity of a fixed rigid body.

    PyBullet never updates the bounds of a replaced heightfield (bullet3 issues 4200 and 4236), and ignores bodies
    outside them. A field's base lies at its middle sample, so a body on it is inside the bounds even if other ground is
    much higher or lower. Bounds of 200 m with a slight tilt would overlap those of many neighbouring bodies.
    """
    bound = bound or min(0.5 * STEEPEST * (max(rows, columns) - 1) * spacing, HOLE)
    heights = [0.0] * (rows * columns)
    heights[0], heights[-1] = -bound, bound
    shape = client.createCollisionShape(
        pb.GEOM_HEIGHTFIELD, meshScale=[spacing, spacing, 1.0], heightfieldData=heights, numHeightfieldRows=rows,
        numHeightfieldColumns=columns,
    )  # fmt: skip
    # Without a visual shape PyBullet creates one of the whole field, which takes a few MiB.
    visual = client.createVisualShape(pb.GEOM_BOX, halfExtents=[1e-3] * 3)
    uid = client.createMultiBody(0.0, shape, visual)
    return Field(rows, columns, spacing, shape, uid, np.full((rows, columns), np.inf))
