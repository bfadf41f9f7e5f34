"""Points, triangles and planes.

Lengths are in metres; all arguments are in one frame with z up. Source of the closest point of a triangle: Ericson,
*Real-Time Collision Detection* (2005), 5.1.5.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled


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
