"""Distance between a triangle and the core of a convex solid, by GJK.

Their Minkowski difference contains the origin if they overlap; otherwise its point nearest to the origin gives distance
and direction. The point is found on a growing and shrinking simplex of support points (Gilbert, Johnson and Keerthi,
1988; van den Bergh, *Collision Detection in Interactive 3D Environments*, 2003, 4.3). All in the solid's own frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Facet, Point, closest_point, cross, dot, minus, scaled
from smartmesh_ros.patches.solids import Solid, core_support

ORIGIN = Point(0.0, 0.0, 0.0)
# Largest difference between the distance found and the true one [m], and largest number of support points.
CLOSE, ITERATIONS = 1e-6, 32
# Distance below which a triangle and a core count as overlapping [m].
OVERLAP = 1e-9


class Separation(NamedTuple):
    """``distance``: between a facet and a core, a lower bound within `CLOSE` [m]; zero if they overlap. ``normal``:
    unit direction from the facet to the core; if they overlap, the last direction that was tried, zero if none was."""

    distance: float
    normal: Point


@compiled
def facet_support(facet: Facet, d: Point) -> Point:
    """Return a facet's corner farthest along a direction."""
    a, b, c = dot(facet.a, d), dot(facet.b, d), dot(facet.c, d)
    if a >= b and a >= c:
        return facet.a
    return facet.b if b >= c else facet.c


@compiled
def on_segment(a: Point, b: Point) -> Point:
    """Return the point of a segment nearest to the origin."""
    ab = minus(b, a)
    square = dot(ab, ab)
    share = min(max(-dot(a, ab) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return Point(a.x + share * ab.x, a.y + share * ab.y, a.z + share * ab.z)


@compiled
def beyond(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return True if the origin is on the other side of the plane through three points than ``d``, or on the plane."""
    normal = cross(minus(b, a), minus(c, a))
    return dot(normal, a) * dot(normal, minus(d, a)) >= 0.0


@compiled
def holds_origin(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return True if the origin is inside a tetrahedron."""
    return not (beyond(a, b, c, d) or beyond(a, b, d, c) or beyond(b, c, d, a) or beyond(c, a, d, b))


@compiled
def separation_of(facet: Facet, solid: Solid, limit: float, near: float) -> Separation:
    """Return how far a facet is from a convex solid's core, without its rounding; ``limit`` and ``near`` [m] as in
    `gap_to`."""
    nearest = closest_point(facet, ORIGIN)
    v = minus(nearest, core_support(solid, nearest))
    count, a, b, c = 1, v, v, v  # the simplex without its newest point
    best, d = Separation(0.0, ORIGIN), ORIGIN
    for _ in range(ITERATIONS):
        length = math.sqrt(dot(v, v))
        if length < OVERLAP:
            return Separation(0.0, d)
        d = scaled(v, -1.0 / length)  # towards the origin: from the facet to the core
        w = minus(facet_support(facet, d), core_support(solid, scaled(d, -1.0)))
        bound = -dot(w, d)  # a plane across d separates by so much
        if bound > best.distance:
            best = Separation(bound, d)
        if best.distance > limit or length - best.distance <= CLOSE:
            return best if best.distance > 0.0 else Separation(0.0, d)
        if best.distance > max(near, 0.0) and length <= limit:
            return best
        if count == 1:
            b, v = w, on_segment(a, w)
            count = 2
        elif count == 2:
            c, v = w, closest_point(Facet(a, b, w), ORIGIN)
            count = 3
        else:
            if best.distance == 0.0 and holds_origin(a, b, c, w):
                return Separation(0.0, d)
            p, q, r = (
                closest_point(Facet(a, b, w), ORIGIN),
                closest_point(Facet(b, c, w), ORIGIN),
                closest_point(Facet(c, a, w), ORIGIN),
            )
            pp, qq, rr = dot(p, p), dot(q, q), dot(r, r)
            if pp <= qq and pp <= rr:
                v, c = p, w
            elif qq <= rr:
                v, a = q, w
            else:
                v, b = r, w
    return best
