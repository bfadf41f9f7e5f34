"""Solids: convex shapes, and compounds of them, at a pose.

A convex solid is a *core* (point, segment, box, cylinder, or hull of vertices), grown by a rounding radius. What the
core computes with solids needs two functions of each kind: the core's farthest point along a direction, and how far
that is.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Point, along, dot, minus
from smartmesh_ros.patches.rotations import rotated
from smartmesh_ros.terrain.grid import FloatArray


class ShapeKind(IntEnum):
    """Kind of a shape, by its core: BALL, a point; CAPSULE, a segment along z; BOX; CYLINDER, about z; HULL, the convex
    hull of vertices; COMPOUND, several of these."""

    BALL = 0
    CAPSULE = 1
    BOX = 2
    CYLINDER = 3
    HULL = 4
    COMPOUND = 5


class Solid(NamedTuple):
    """A shape at a pose.

    ``kind``: a `ShapeKind`. ``centre``; unit axes ``u``, ``v``, ``w``; ``half`` extents of the core along them; the
    ``rounding`` radius by which the core is grown; ``reach``: bounding radius about the centre. ``first``, ``rows``:
    first row and number of rows of a hull in ``vertices`` (V, 3), or of a compound in ``parts``, both in the solid's
    own frame.
    """

    kind: int
    centre: Point
    u: Point
    v: Point
    w: Point
    half: Point
    rounding: float
    reach: float
    first: int
    rows: int
    vertices: FloatArray
    parts: Any


@compiled
def is_round(kind: int) -> bool:
    """Return True if turning a shape of this kind about its z axis changes nothing."""
    return kind == ShapeKind.CAPSULE or kind == ShapeKind.CYLINDER or kind == ShapeKind.BALL


@compiled
def in_frame(solid: Solid, p: Point) -> Point:
    """Transform a point into the solid's own frame."""
    return turned_in(solid, minus(p, solid.centre))


@compiled
def turned_in(solid: Solid, d: Point) -> Point:
    """Rotate a vector into the solid's own frame."""
    return Point(dot(solid.u, d), dot(solid.v, d), dot(solid.w, d))


@compiled
def out_of_frame(solid: Solid, p: Point) -> Point:
    """Rotate a vector from the solid's own frame into the outer frame."""
    return Point(
        solid.u.x * p.x + solid.v.x * p.y + solid.w.x * p.z,
        solid.u.y * p.x + solid.v.y * p.y + solid.w.y * p.z,
        solid.u.z * p.x + solid.v.z * p.y + solid.w.z * p.z,
    )


@compiled
def farthest_vertex(solid: Solid, d: Point) -> int:
    """Return the row of a hull's vertex that is farthest along a direction in its own frame."""
    best, found = -math.inf, solid.first
    for k in range(solid.first, solid.first + solid.rows):
        far = solid.vertices[k, 0] * d.x + solid.vertices[k, 1] * d.y + solid.vertices[k, 2] * d.z
        if far > best:
            best, found = far, k
    return found


@compiled
def vertex_of(solid: Solid, k: int) -> Point:
    """Return a hull's vertex in row ``k``, in the hull's own frame."""
    return Point(solid.vertices[k, 0], solid.vertices[k, 1], solid.vertices[k, 2])


@compiled
def core_support(solid: Solid, d: Point) -> Point:
    """Return the farthest point of a convex solid's core along a direction, both in its own frame."""
    half = solid.half
    if solid.kind == ShapeKind.HULL:
        return vertex_of(solid, farthest_vertex(solid, d))
    if solid.kind == ShapeKind.CYLINDER:
        aside = math.sqrt(d.x * d.x + d.y * d.y)
        share = half.x / aside if aside > 0.0 else 0.0
        return Point(share * d.x, share * d.y, math.copysign(half.z, d.z))
    return Point(math.copysign(half.x, d.x), math.copysign(half.y, d.y), math.copysign(half.z, d.z))


@compiled
def convex_reach(solid: Solid, direction: Point) -> float:
    """Distance from the centre of a convex solid to its farthest point along a unit direction."""
    if solid.kind == ShapeKind.BALL:
        return solid.rounding
    d = turned_in(solid, direction)
    if solid.kind == ShapeKind.HULL:
        return dot(vertex_of(solid, farthest_vertex(solid, d)), d) + solid.rounding
    if solid.kind == ShapeKind.CYLINDER:
        return solid.half.x * math.sqrt(d.x * d.x + d.y * d.y) + solid.half.z * abs(d.z) + solid.rounding
    return solid.half.x * abs(d.x) + solid.half.y * abs(d.y) + solid.half.z * abs(d.z) + solid.rounding


@compiled
def part_centre(solid: Solid, k: int) -> Point:
    """Return the centre of the part of a compound in row ``k`` of its ``parts``."""
    offset = solid.parts[k].offset
    return along(solid.centre, 1.0, out_of_frame(solid, Point(offset[0], offset[1], offset[2])))


@compiled
def part_of(solid: Solid, k: int) -> Solid:
    """Return the part of a compound in row ``k`` of its ``parts``."""
    part = solid.parts[k]
    turn = (part.turn[0], part.turn[1], part.turn[2], part.turn[3])
    return Solid(
        part.kind,
        part_centre(solid, k),
        out_of_frame(solid, rotated(turn, Point(1.0, 0.0, 0.0))),
        out_of_frame(solid, rotated(turn, Point(0.0, 1.0, 0.0))),
        out_of_frame(solid, rotated(turn, Point(0.0, 0.0, 1.0))),
        Point(part.half[0], part.half[1], part.half[2]),
        part.rounding,
        part.reach,
        part.first,
        part.rows,
        solid.vertices,
        solid.parts,
    )


@compiled
def reach_along(solid: Solid, direction: Point) -> float:
    """Distance from a solid's centre to its farthest point along a unit direction."""
    if solid.kind != ShapeKind.COMPOUND:
        return convex_reach(solid, direction)
    most = -math.inf
    for k in range(solid.first, solid.first + solid.rows):
        middle = dot(minus(part_centre(solid, k), solid.centre), direction)
        if middle + solid.parts[k].reach > most:
            most = max(most, middle + convex_reach(part_of(solid, k), direction))
    return most


@compiled
def extents(solid: Solid) -> Point:
    """Half extents of an axis-aligned box around a solid's centre that holds the solid; the smallest one for all but
    hulls and compounds."""
    if solid.kind == ShapeKind.CYLINDER:
        return Point(
            convex_reach(solid, Point(1.0, 0.0, 0.0)),
            convex_reach(solid, Point(0.0, 1.0, 0.0)),
            convex_reach(solid, Point(0.0, 0.0, 1.0)),
        )
    u, v, w, half, rounding = solid.u, solid.v, solid.w, solid.half, solid.rounding
    return Point(
        abs(u.x) * half.x + abs(v.x) * half.y + abs(w.x) * half.z + rounding,
        abs(u.y) * half.x + abs(v.y) * half.y + abs(w.y) * half.z + rounding,
        abs(u.z) * half.x + abs(v.z) * half.y + abs(w.z) * half.z + rounding,
    )


@compiled
def moved_by(solid: Solid, path: Point, share: float) -> Solid:
    """A solid moved by a share of a path."""
    return Solid(
        solid.kind, along(solid.centre, share, path), solid.u, solid.v, solid.w, solid.half, solid.rounding,
        solid.reach, solid.first, solid.rows, solid.vertices, solid.parts,
    )  # fmt: skip
