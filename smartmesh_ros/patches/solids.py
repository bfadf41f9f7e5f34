"""Bounding boxes of the shapes of bodies, for compiled functions."""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.shapes import ShapeKind, Shapes
from smartmesh_ros.terrain.grid import FloatArray

Turn = tuple[float, float, float, float]  # a rotation as a unit quaternion (x, y, z, w)


class Point(NamedTuple):
    """A point or vector [m]."""

    x: float
    y: float
    z: float


class Solid(NamedTuple):
    """A shape at a pose: ``centre``; unit axes ``u``, ``v``, ``w``; ``half`` extents of the core along them; the
    ``rounding`` radius by which the core is grown."""

    kind: int
    centre: Point
    u: Point
    v: Point
    w: Point
    half: Point
    rounding: float


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
    x, y, z = q[1] * p.z - q[2] * p.y, q[2] * p.x - q[0] * p.z, q[0] * p.y - q[1] * p.x
    x, y, z = 2.0 * x, 2.0 * y, 2.0 * z
    return Point(
        p.x + q[3] * x + (q[1] * z - q[2] * y), p.y + q[3] * y + (q[2] * x - q[0] * z),
        p.z + q[3] * z + (q[0] * y - q[1] * x),
    )  # fmt: skip


@compiled
def solid_of(shapes: Shapes, slot: int, body: FloatArray) -> Solid:
    """The solid of a shape on a body (13,), in the frame of the body's pose."""
    shape = shapes.table[slot]
    turn = (body[3], body[4], body[5], body[6])
    away = rotated(turn, Point(shape.offset[0], shape.offset[1], shape.offset[2]))
    turn = product(turn, (shape.turn[0], shape.turn[1], shape.turn[2], shape.turn[3]))
    return Solid(
        shape.kind, Point(body[0] + away.x, body[1] + away.y, body[2] + away.z), rotated(turn, Point(1.0, 0.0, 0.0)),
        rotated(turn, Point(0.0, 1.0, 0.0)), rotated(turn, Point(0.0, 0.0, 1.0)),
        Point(shape.half[0], shape.half[1], shape.half[2]), shape.rounding,
    )  # fmt: skip


@compiled
def extents(solid: Solid) -> Point:
    """Half extents of an axis-aligned box around a solid's centre that holds the solid; the smallest one for all but
    hulls and compounds."""
    u, v, w, half, rounding = solid.u, solid.v, solid.w, solid.half, solid.rounding
    if solid.kind == ShapeKind.CYLINDER:
        return Point(
            half.x * math.sqrt(u.x * u.x + v.x * v.x) + half.z * abs(w.x) + rounding,
            half.x * math.sqrt(u.y * u.y + v.y * v.y) + half.z * abs(w.y) + rounding,
            half.x * math.sqrt(u.z * u.z + v.z * v.z) + half.z * abs(w.z) + rounding,
        )
    return Point(
        abs(u.x) * half.x + abs(v.x) * half.y + abs(w.x) * half.z + rounding,
        abs(u.y) * half.x + abs(v.y) * half.y + abs(w.y) * half.z + rounding,
        abs(u.z) * half.x + abs(v.z) * half.y + abs(w.z) * half.z + rounding,
    )
