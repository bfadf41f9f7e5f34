"""The gap between a triangle and a solid, and a triangle's deviation from a plane near a solid.

Source of the separating axes of a box and a triangle: Akenine-Möller, *Fast 3D Triangle-Box Overlap Testing* (2001).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import (
    Facet,
    Point,
    closest_point,
    cross,
    dot,
    facet_normal,
    minus,
    scaled,
)
from smartmesh_ros.patches.gjk import separation_of
from smartmesh_ros.patches.solids import (
    ShapeKind,
    Solid,
    convex_reach,
    in_frame,
    out_of_frame,
    part_centre,
    part_of,
)

# Smallest squared length of a cross product of edges that counts as a separating axis [m^2]. Cross products of nearly
# parallel edges are rounding noise.
PARALLEL = 1e-12


class Gap(NamedTuple):
    """``distance``: between a facet and a solid, negative if they overlap. ``normal``: unit direction from the facet to
    the solid. ``nearest``: the facet's point nearest to the solid's centre."""

    distance: float
    normal: Point
    nearest: Point


@compiled
def ball_gap(facet: Facet, centre: Point, radius: float) -> Gap:
    """The gap between a facet and a ball."""
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
def box_gap(facet: Facet, solid: Solid) -> Gap:
    """The gap between a facet and a box, from the largest separation along their 13 axes; a lower bound if they do not
    overlap."""
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
def separation_along(facet: Facet, solid: Solid, axis: Point) -> float:
    """Signed distance between a facet and a convex solid that lies beyond it along a unit axis."""
    high = max(dot(axis, facet.a), dot(axis, facet.b), dot(axis, facet.c))
    return dot(axis, solid.centre) - convex_reach(solid, scaled(axis, -1.0)) - high


@compiled
def overlap_gap(facet: Facet, solid: Solid, nearest: Point, towards: Point, near: float) -> Gap:
    """The gap between a facet and a convex solid whose core overlaps it: the smallest depth along the facet's normal,
    the solid's axes, and the direction ``towards`` which they were last apart; or any that exceeds ``near`` [m]."""
    best, normal = -math.inf, facet_normal(facet)
    for axis in (facet_normal(facet), solid.u, solid.v, solid.w, towards):
        if dot(axis, axis) == 0.0:
            continue
        for side in (1.0, -1.0):
            outward = scaled(axis, side)
            gap = separation_along(facet, solid, outward)
            if gap > best:
                best, normal = gap, outward
                if best > near:
                    return Gap(best, normal, nearest)
    return Gap(best, normal, nearest)


@compiled
def convex_gap(facet: Facet, solid: Solid, limit: float, near: float) -> Gap:
    """The gap between a facet and a convex solid, from the distance of its core; see `gap_to`."""
    nearest = closest_point(facet, solid.centre)
    own = Facet(in_frame(solid, facet.a), in_frame(solid, facet.b), in_frame(solid, facet.c))
    core = separation_of(own, solid, limit + solid.rounding, near + solid.rounding)
    if core.distance > 0.0:
        return Gap(core.distance - solid.rounding, out_of_frame(solid, core.normal), nearest)
    return overlap_gap(facet, solid, nearest, out_of_frame(solid, core.normal), near)


@compiled
def gap_to_convex(facet: Facet, solid: Solid, limit: float, near: float) -> Gap:
    """The gap between a facet and a convex solid; see `gap_to`."""
    if solid.kind == ShapeKind.BALL:
        return ball_gap(facet, solid.centre, solid.rounding)
    if solid.kind == ShapeKind.BOX:
        gap = box_gap(facet, solid)
        if not 0.0 < gap.distance <= limit:
            return gap
        exact = convex_gap(facet, solid, limit, near)
        return exact if exact.distance > gap.distance else gap
    return convex_gap(facet, solid, limit, near)


@compiled
def gap_to(facet: Facet, solid: Solid, limit: float = math.inf, near: float = math.inf) -> Gap:
    """The gap between a facet and a solid.

    A distance above ``limit`` [m] (at least zero) may be less than the true one, and so may a distance between ``near``
    [m] and ``limit``, but each stays in its range. A search for the nearest facet within a limit needs exact gaps only
    up to the smallest one so far.
    """
    if solid.kind != ShapeKind.COMPOUND:
        return gap_to_convex(facet, solid, limit, near)
    best = Gap(math.inf, Point(0.0, 0.0, 1.0), solid.centre)
    for k in range(solid.first, solid.first + solid.rows):
        least = min(limit, best.distance)
        around = ball_gap(facet, part_centre(solid, k), solid.parts[k].reach)
        if around.distance > least:
            best = best if best.distance < around.distance else around
            continue
        gap = gap_to_convex(facet, part_of(solid, k), least, near)
        if gap.distance < best.distance:
            best = gap
    return best
