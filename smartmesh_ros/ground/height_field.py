"""PyBullet's height fields."""

from __future__ import annotations

import math
from typing import Any

import pybullet as pb

from smartmesh_ros.terrain.grid import FloatArray


def in_order(heights: FloatArray) -> list[float]:
    """Return heights (rows, columns) in PyBullet's order.

    The shape is rotated by 90 degrees from its grid, because PyBullet splits cells along the other diagonal than the
    main mesh, and the rotation makes the two agree (row r, column c of the grid is PyBullet's row columns - 1 - c,
    column r). PyBullet's first index runs along its x axis, although the argument is called columns.
    """
    order: list[float] = heights[:, ::-1].T.ravel().tolist()
    return order


def quarter_turn(yaw: float) -> tuple[float, float, float, float]:
    """Orientation (x, y, z, w) of the body of a field over a grid with a ``yaw`` [rad]: 90 degrees more, see
    `in_order`."""
    half = 0.5 * (yaw + 0.5 * math.pi)
    return 0.0, 0.0, math.sin(half), math.cos(half)


def make_shape(client: Any, rows: int, columns: int, spacing: float, bound: float) -> int:
    """Create the shape of a field whose heights may later differ by ``bound`` [m] from its base.

    PyBullet never updates the bounds of a field whose heights are replaced (bullet3 issues 4200 and 4236), and ignores
    what is outside them.
    """
    heights = [0.0] * (rows * columns)
    heights[0], heights[-1] = -bound, bound
    return int(
        client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD, meshScale=[spacing, spacing, 1.0], heightfieldData=heights, numHeightfieldRows=rows,
            numHeightfieldColumns=columns,
        )
    )  # fmt: skip


def replace_heights(client: Any, shape: int, heights: FloatArray) -> None:
    """Replace the heights (rows, columns) [m] of a field above its base; PyBullet cannot change the size."""
    rows, columns = heights.shape
    client.createCollisionShape(
        pb.GEOM_HEIGHTFIELD, heightfieldData=in_order(heights), numHeightfieldRows=rows,
        numHeightfieldColumns=columns, replaceHeightfieldIndex=shape,
    )  # fmt: skip
