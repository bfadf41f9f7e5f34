"""Rotations as unit quaternions (x, y, z, w) for compiled functions."""

from __future__ import annotations

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Point, along, cross, scaled

Turn = tuple[float, float, float, float]


@compiled
def product(a: Turn, b: Turn) -> Turn:
    """The rotation ``b`` followed by ``a``."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@compiled
def rotated(q: Turn, p: Point) -> Point:
    """Rotate a vector."""
    axis = Point(q[0], q[1], q[2])
    twice = scaled(cross(axis, p), 2.0)
    return along(along(p, q[3], twice), 1.0, cross(axis, twice))
