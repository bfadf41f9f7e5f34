"""Triangles and convex shapes: the gap between them, and a triangle's deviation from a plane near a shape.

Lengths are in metres; all arguments are in one frame with z up. Sources: closest point of a triangle, Ericson,
*Real-Time Collision Detection* (2005), 5.1.5; separating axes of a box and a triangle, Akenine-Möller, *Fast 3D
Triangle-Box Overlap Testing* (2001).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled

# Smallest squared length of a cross product of edges that counts as a separating axis [m^2]. Cross products of nearly
# parallel edges are rounding noise.
PARALLEL = 1e-12


class Point(NamedTuple):
    """A point or vector [m]."""

    x: float
    y: float
    z: float


class Facet(NamedTuple):
    """A triangle, counter-clockwise as seen from the side of the bodies."""

    a: Point
    b: Point
    c: Point


class Plane(NamedTuple):
    """The plane z = ``height`` + ``slope_x`` x + ``slope_y`` y [m, -, -]."""

    height: float
    slope_x: float
    slope_y: float


class Solid(NamedTuple):
    """A ball, or an oriented box.

    ``ball``: True for a ball of ``radius``; otherwise ``u``, ``v``, ``w`` are the unit axes of a box and ``half`` its
    half extents along them. ``centre``: middle of the solid.
    """

    ball: bool
    radius: float
    centre: Point
    u: Point
    v: Point
    w: Point
    half: Point


class Gap(NamedTuple):
    """``distance``: a lower bound on the distance between a facet and a solid, negative if they overlap. ``normal``:
    unit direction from the facet to the solid. ``nearest``: the facet's point nearest to the solid's centre."""

    distance: float
    normal: Point
    nearest: Point


@compiled
def minus(a: Point, b: Point) -> Point:
    """a - b."""
    return Point(a.x - b.x, a.y - b.y, a.z - b.z)


@compiled
def dot(a: Point, b: Point) -> float:
    """Scalar product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@compiled
def cross(a: Point, b: Point) -> Point:
    """Vector product."""
    return Point(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@compiled
def along(a: Point, share: float, direction: Point) -> Point:
    """a + share * direction."""
    return Point(a.x + share * direction.x, a.y + share * direction.y, a.z + share * direction.z)


@compiled
def scaled(a: Point, factor: float) -> Point:
    """factor * a."""
    return Point(factor * a.x, factor * a.y, factor * a.z)


@compiled
def facet_normal(facet: Facet) -> Point:
    """Unit normal towards the side of the bodies; zero for a facet without area."""
    n = cross(minus(facet.b, facet.a), minus(facet.c, facet.a))
    length = math.sqrt(dot(n, n))
    return scaled(n, 1.0 / length) if length > 0.0 else Point(0.0, 0.0, 0.0)


@compiled
def closest_point(facet: Facet, p: Point) -> Point:
    """The point of a facet closest to ``p``."""
    ab, ac, ap = minus(facet.b, facet.a), minus(facet.c, facet.a), minus(p, facet.a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return facet.a
    bp = minus(p, facet.b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return facet.b
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return along(facet.a, d1 / (d1 - d3), ab)
    cp = minus(p, facet.c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return facet.c
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return along(facet.a, d2 / (d2 - d6), ac)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return along(facet.b, (d4 - d3) / ((d4 - d3) + (d5 - d6)), minus(facet.c, facet.b))
    share = 1.0 / (va + vb + vc)
    return along(along(facet.a, vb * share, ab), vc * share, ac)


@compiled
def ball_gap(facet: Facet, centre: Point, radius: float) -> Gap:
    """The exact gap between a facet and a ball."""
    nearest = closest_point(facet, centre)
    away = minus(centre, nearest)
    distance = math.sqrt(dot(away, away))
    if distance > 1e-9:
        return Gap(distance - radius, scaled(away, 1.0 / distance), nearest)
    return Gap(-radius, facet_normal(facet), nearest)


@compiled
def separation(axis: Point, a: Point, b: Point, c: Point, half: Point) -> tuple[float, float]:
    """Signed distance between a triangle (in the box's frame) and the box along a unit axis, and the side of the
    triangle on which the box lies (-1 or 1)."""
    p, q, r = dot(axis, a), dot(axis, b), dot(axis, c)
    low, high = min(p, q, r), max(p, q, r)
    reach = half.x * abs(axis.x) + half.y * abs(axis.y) + half.z * abs(axis.z)
    if low - reach >= -high - reach:
        return low - reach, -1.0
    return -high - reach, 1.0


@compiled
def in_frame(solid: Solid, p: Point) -> Point:
    """Transform a point into the solid's own frame."""
    away = minus(p, solid.centre)
    return Point(dot(solid.u, away), dot(solid.v, away), dot(solid.w, away))


@compiled
def out_of_frame(solid: Solid, p: Point) -> Point:
    """Rotate a vector from the solid's own frame into the outer frame."""
    return along(along(scaled(solid.u, p.x), p.y, solid.v), p.z, solid.w)


@compiled
def box_gap(facet: Facet, solid: Solid) -> Gap:
    """The gap between a facet and a box: the largest separation along their 13 axes."""
    a, b, c = in_frame(solid, facet.a), in_frame(solid, facet.b), in_frame(solid, facet.c)
    half = solid.half
    ab, bc, ca = minus(b, a), minus(c, b), minus(a, c)
    best, axis = -math.inf, Point(0.0, 0.0, 1.0)
    normal = cross(ab, minus(c, a))
    length = dot(normal, normal)
    if length > 0.0:
        normal = scaled(normal, 1.0 / math.sqrt(length))
        best, side = separation(normal, a, b, c, half)
        axis = scaled(normal, side)
    for face in (Point(1.0, 0.0, 0.0), Point(0.0, 1.0, 0.0), Point(0.0, 0.0, 1.0)):
        gap, side = separation(face, a, b, c, half)
        if gap > best:
            best, axis = gap, scaled(face, side)
    for edge in (ab, bc, ca):
        for crossed in (Point(0.0, -edge.z, edge.y), Point(edge.z, 0.0, -edge.x), Point(-edge.y, edge.x, 0.0)):
            length = dot(crossed, crossed)
            if length > PARALLEL:
                unit = scaled(crossed, 1.0 / math.sqrt(length))
                gap, side = separation(unit, a, b, c, half)
                if gap > best:
                    best, axis = gap, scaled(unit, side)
    return Gap(best, out_of_frame(solid, axis), closest_point(facet, solid.centre))


@compiled
def gap_to(facet: Facet, solid: Solid) -> Gap:
    """The gap between a facet and a solid."""
    if solid.ball:
        return ball_gap(facet, solid.centre, solid.radius)
    return box_gap(facet, solid)


@compiled
def moved_by(solid: Solid, path: Point, share: float) -> Solid:
    """A solid moved by a share of a path."""
    centre = along(solid.centre, share, path)
    return Solid(solid.ball, solid.radius, centre, solid.u, solid.v, solid.w, solid.half)


@compiled
def plane_of(facet: Facet) -> Plane:
    """The plane of a facet that is not vertical."""
    n = cross(minus(facet.b, facet.a), minus(facet.c, facet.a))
    slope_x, slope_y = -n.x / n.z, -n.y / n.z
    return Plane(facet.a.z - slope_x * facet.a.x - slope_y * facet.a.y, slope_x, slope_y)


@compiled
def height_of(plane: Plane, x: float, y: float) -> float:
    """Height of a plane at (x, y)."""
    return plane.height + plane.slope_x * x + plane.slope_y * y


@compiled
def plane_normal(plane: Plane) -> Point:
    """Upward unit normal of a plane."""
    z = 1.0 / math.sqrt(1.0 + plane.slope_x * plane.slope_x + plane.slope_y * plane.slope_y)
    return Point(-plane.slope_x * z, -plane.slope_y * z, z)


@compiled
def reach_along(solid: Solid, direction: Point) -> float:
    """Distance from a solid's centre to its surface's farthest point along a unit direction."""
    if solid.ball:
        return solid.radius
    return (
        solid.half.x * abs(dot(solid.u, direction))
        + solid.half.y * abs(dot(solid.v, direction))
        + solid.half.z * abs(dot(solid.w, direction))
    )


@compiled
def deviation_near(facet: Facet, plane: Plane, solid: Solid, gap: Gap, margin: float) -> float:
    """Bound on the vertical distance between a facet and a plane where a solid grown by ``margin`` can touch the facet.

    The difference of the two is linear, so its maximum is at one of the facet's corners. A second bound covers only the
    part that the solid can reach. For a ball, this part is the points of the facet within the chord around the facet's
    nearest point (projection onto a convex set). For a box, it is the box's extent along the gradient of the
    difference.
    """
    a = facet.a.z - height_of(plane, facet.a.x, facet.a.y)
    b = facet.b.z - height_of(plane, facet.b.x, facet.b.y)
    c = facet.c.z - height_of(plane, facet.c.x, facet.c.y)
    corners = max(abs(a), abs(b), abs(c))
    own = plane_of(facet)
    tilt_x, tilt_y = own.slope_x - plane.slope_x, own.slope_y - plane.slope_y
    tilt = math.sqrt(tilt_x * tilt_x + tilt_y * tilt_y)
    if tilt == 0.0:
        return corners
    if solid.ball:
        reach, distance = solid.radius + margin, gap.distance + solid.radius
        x, y = gap.nearest.x, gap.nearest.y
        swing = tilt * math.sqrt(max(reach * reach - distance * distance, 0.0))
    else:
        x, y = solid.centre.x, solid.centre.y
        swing = tilt * (reach_along(solid, Point(tilt_x / tilt, tilt_y / tilt, 0.0)) + margin)
    return min(corners, abs(height_of(own, x, y) - height_of(plane, x, y)) + swing)
