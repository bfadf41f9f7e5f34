"""Shapes and poses of bodies for compiled functions."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Point, Solid, along, cross, scaled


class ShapeKind(IntEnum):
    """Kind of a shape: a ball; a box; or a body of revolution about its z axis (cylinder, capsule). ROUND is treated as
    a box that is rotated about this axis until one of its sides is as level as possible."""

    BALL = 0
    BOX = 1
    ROUND = 2


# ``kind``: a `ShapeKind`; ``half``: half extents along the shape's axes [m], a ball's radius in all three; ``offset``
# [m] and ``turn`` (x, y, z, w): pose of the shape in the frame of the body's centre of mass; ``radius`` [m]: bounding
# radius about the centre of mass.
SHAPE = np.dtype(
    [
        ("kind", np.int64),
        ("half_x", np.float64),
        ("half_y", np.float64),
        ("half_z", np.float64),
        ("offset", np.float64, (3,)),
        ("turn", np.float64, (4,)),
        ("radius", np.float64),
    ]
)

# Columns of a table of bodies (N, 13): position [m], orientation (x, y, z, w), velocity [m/s], angular velocity
# [rad/s].
BODY_COLUMNS = 13


@compiled
def product(a, b):
    """The rotation ``b`` followed by ``a``, as unit quaternions (x, y, z, w)."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@compiled
def rotated(q, p: Point) -> Point:
    """Rotate a vector by a unit quaternion (x, y, z, w)."""
    axis = Point(q[0], q[1], q[2])
    twice = scaled(cross(axis, p), 2.0)
    return along(along(p, q[3], twice), 1.0, cross(axis, twice))


@compiled
def solid_of(shape, body) -> Solid:
    """The solid of a record of ``SHAPE`` on a body (13,), in the frame of the body's pose."""
    orientation = (body[3], body[4], body[5], body[6])
    offset = Point(shape.offset[0], shape.offset[1], shape.offset[2])
    centre = along(Point(body[0], body[1], body[2]), 1.0, rotated(orientation, offset))
    half = Point(shape.half_x, shape.half_y, shape.half_z)
    x, y, z = Point(1.0, 0.0, 0.0), Point(0.0, 1.0, 0.0), Point(0.0, 0.0, 1.0)
    if shape.kind == ShapeKind.BALL:
        return Solid(True, half.x, centre, x, y, z, half)
    turn = product(orientation, (shape.turn[0], shape.turn[1], shape.turn[2], shape.turn[3]))
    w = rotated(turn, z)
    level = math.hypot(w.x, w.y)
    if shape.kind == ShapeKind.ROUND and level > 1e-6:
        u = Point(-w.y / level, w.x / level, 0.0)  # level, and across the axis
        return Solid(False, 0.0, centre, u, cross(w, u), w, half)
    return Solid(False, 0.0, centre, rotated(turn, x), rotated(turn, y), w, half)
