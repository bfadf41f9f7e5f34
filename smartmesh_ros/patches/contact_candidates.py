"""Contact candidates: the facets in a window of samples that a solid can reach until the next update."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import (
    Facet,
    Plane,
    Point,
    dot,
    height_of,
    minus,
    plane_normal,
    plane_of,
    scaled,
)
from smartmesh_ros.patches.gaps import Gap, deviation_near, gap_to, gap_to_convex
from smartmesh_ros.patches.solids import ShapeKind, Solid, extents, in_frame, out_of_frame, part_of, reach_along
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.moving_grid import triangle_weights

# Weight of a facet's distance to the solid's centre in the choice of the nearest facet [-]; breaks ties between gaps.
TIE = 1e-6
# Points determine no plane if their spread along one direction is less than this share of the spread along the other
# (ratio of the determinant of their second moments to the squared trace).
THIN = 1e-4
UP = Point(0.0, 0.0, 1.0)


class Window(NamedTuple):
    """Samples (h, w): ``heights`` now [m], and ``rises``, their change until the next update [m]. Sample (a, b) is at x
    = b ``spacing``, y = a ``spacing`` [m]; NaN = no ground."""

    heights: FloatArray
    rises: FloatArray
    spacing: float


class Travel(NamedTuple):
    """Predicted motion of a solid until the next update: a straight path (``x``, ``y``, ``z``) [m], and ``more`` [m], a
    bound on additional motion in any direction."""

    x: float
    y: float
    z: float
    more: float


class Candidates(NamedTuple):
    """The ground that a solid can touch: number of ``facets``; rows ``top`` to ``bottom`` and columns ``left`` to
    ``right`` of their cells; the nearest facet (cell ``a``, ``b``, ``upper``) and its ``gap``; the largest ``margin``
    of all facets [m]."""

    facets: int
    top: int
    bottom: int
    left: int
    right: int
    a: int
    b: int
    upper: int
    gap: Gap
    margin: float


@compiled
def facet_of(heights: FloatArray, spacing: float, a: int, b: int, upper: int) -> Facet:
    """The facet of cell (a, b) below its diagonal, or the ``upper`` one."""
    x, y = b * spacing, a * spacing
    first = Point(x, y, heights[a, b])
    opposite = Point(x + spacing, y + spacing, heights[a + 1, b + 1])
    if upper == 1:
        return Facet(first, opposite, Point(x, y + spacing, heights[a + 1, b]))
    return Facet(first, Point(x + spacing, y, heights[a, b + 1]), opposite)


@compiled
def is_ground(facet: Facet) -> bool:
    """Return True if no corner of a facet is a hole."""
    return not math.isnan(facet.a.z + facet.b.z + facet.c.z)


@compiled
def heights_of_cell(heights: FloatArray, a: int, b: int) -> tuple[float, float]:
    """Lowest and highest corner of cell (a, b), ignoring holes; infinite if all corners are holes."""
    low, high = math.inf, -math.inf
    for z in (heights[a, b], heights[a, b + 1], heights[a + 1, b], heights[a + 1, b + 1]):
        if z < low:
            low = z
        if z > high:
            high = z
    return low, high


@compiled
def margin_of(rises: Facet, travel: Travel) -> float:
    """Bound on a solid's motion relative to a facet whose corners rise by the heights of ``rises`` [m]."""
    vertical = max(abs(travel.z - rises.a.z), abs(travel.z - rises.b.z), abs(travel.z - rises.c.z))
    return math.sqrt(travel.x * travel.x + travel.y * travel.y + vertical * vertical) + travel.more


@compiled
def out_of_reach(
    solid: Solid, extent: Point, x: float, y: float, spacing: float, low: float, high: float, margin: float
) -> bool:
    """Return True if a cell at (x, y), between the heights ``low`` and ``high``, is certainly farther than ``margin``
    from a solid with half extents ``extent``. The test is conservative: False proves nothing."""
    centre = solid.centre
    away = Point(
        max(x - centre.x, 0.0) - max(centre.x - x - spacing, 0.0),
        max(y - centre.y, 0.0) - max(centre.y - y - spacing, 0.0),
        max(low - centre.z, 0.0) - max(centre.z - high, 0.0),
    )
    if abs(away.x) > extent.x + margin or abs(away.y) > extent.y + margin or abs(away.z) > extent.z + margin:
        return True
    if solid.kind == ShapeKind.COMPOUND:
        return False
    distance = math.sqrt(dot(away, away))  # of the box around the cell from the solid's centre
    if distance - solid.reach > margin:
        return True
    return distance > margin and distance - reach_along(solid, scaled(away, 1.0 / distance)) > margin


@compiled
def largest_margin(window: Window, travel: Travel) -> float:
    """Bound on a solid's motion relative to all ground of a window [m]."""
    fastest = 0.0
    high, wide = window.rises.shape
    for a in range(high):
        for b in range(wide):
            fastest = max(fastest, abs(travel.z - window.rises[a, b]))
    return math.sqrt(travel.x * travel.x + travel.y * travel.y + fastest * fastest) + travel.more


@compiled
def highest(window: Window) -> float:
    """Highest sample of a window [m]; minus infinity if all are holes."""
    top = -math.inf
    high, wide = window.heights.shape
    for a in range(high):
        for b in range(wide):
            if window.heights[a, b] > top:
                top = window.heights[a, b]
    return top


@compiled
def no_candidates(window: Window, solid: Solid) -> Candidates:
    """The candidates of a solid that reaches no facet of a window."""
    high, wide = window.heights.shape
    return Candidates(0, high, -1, wide, -1, 0, 0, 0, Gap(math.inf, UP, solid.centre), 0.0)


@compiled
def cells_near(window: Window, solid: Solid, extent: Point, margin: float) -> tuple[int, int, int, int]:
    """Return the rows (first, end) and columns (first, end) of the cells within ``margin`` [m] of a solid's bounds."""
    high, wide = window.heights.shape
    x, y, spacing = solid.centre.x, solid.centre.y, window.spacing
    return (
        max(math.floor((y - extent.y - margin) / spacing), 0),
        min(math.floor((y + extent.y + margin) / spacing) + 1, high - 1),
        max(math.floor((x - extent.x - margin) / spacing), 0),
        min(math.floor((x + extent.x + margin) / spacing) + 1, wide - 1),
    )


@compiled
def with_facets_of(
    window: Window, solid: Solid, travel: Travel, most: float, found: Candidates, marks: NDArray[np.uint8]
) -> Candidates:
    """Return the candidates ``found`` so far and those of a convex solid, which moves by up to ``most`` [m] relative to
    the ground; marks them as `candidate_facets` does."""
    count, top, bottom, left, right, best_a, best_b, best_upper, nearest, widest = found
    extent, best = extents(solid), rank_of(nearest, solid)
    first_row, end_row, first_column, end_column = cells_near(window, solid, extent, most)
    for a in range(first_row, end_row):
        for b in range(first_column, end_column):
            x, y = b * window.spacing, a * window.spacing
            low, top_z = heights_of_cell(window.heights, a, b)
            if out_of_reach(solid, extent, x, y, window.spacing, low, top_z, most):
                continue
            for upper in range(2):
                facet = facet_of(window.heights, window.spacing, a, b, upper)
                if not is_ground(facet):
                    continue
                margin = margin_of(facet_of(window.rises, window.spacing, a, b, upper), travel)
                gap = gap_to_convex(facet, solid, margin, best)
                if gap.distance > margin:
                    continue
                if not marks[a, b] & (1 + upper):
                    marks[a, b] |= 1 + upper
                    count += 1
                top, bottom, left, right = min(top, a), max(bottom, a), min(left, b), max(right, b)
                widest = max(widest, margin)
                rank = rank_of(gap, solid)
                if rank < best:
                    best, best_a, best_b, best_upper, nearest = rank, a, b, upper, gap
    return Candidates(count, top, bottom, left, right, best_a, best_b, best_upper, nearest, widest)


@compiled
def rank_of(gap: Gap, solid: Solid) -> float:
    """Return the rank of a gap, smallest for the nearest facet: its distance, and a little of that to the centre."""
    away = minus(gap.nearest, solid.centre)
    return gap.distance + TIE * math.sqrt(dot(away, away))


@compiled
def candidate_facets(window: Window, solid: Solid, travel: Travel, marks: NDArray[np.uint8]) -> Candidates:
    """Find the facets that a solid can touch, and write them to ``marks`` (h - 1, w - 1): bit 1 for the facet below a
    cell's diagonal, bit 2 for the one above. The result is conservative: it may contain too many facets, never too
    few."""
    high, wide = window.heights.shape
    for a in range(high - 1):
        for b in range(wide - 1):
            marks[a, b] = 0
    found, most = no_candidates(window, solid), largest_margin(window, travel)
    if solid.centre.z - extents(solid).z - most > highest(window):
        return found
    if solid.kind != ShapeKind.COMPOUND:
        return with_facets_of(window, solid, travel, most, found, marks)
    for k in range(solid.first, solid.first + solid.rows):
        found = with_facets_of(window, part_of(solid, k), travel, most, found, marks)
    return found


@compiled
def nearest_facet(window: Window, solid: Solid) -> Candidates:
    """Return the facet nearest to a solid as its only candidate; none if there is no ground."""
    high, wide = window.heights.shape
    found, best = no_candidates(window, solid), math.inf
    for a in range(high - 1):
        for b in range(wide - 1):
            for upper in range(2):
                facet = facet_of(window.heights, window.spacing, a, b, upper)
                if not is_ground(facet):
                    continue
                gap = gap_to(facet, solid, best)
                rank = rank_of(gap, solid)
                if rank < best:
                    best, found = rank, Candidates(1, a, a, b, b, a, b, upper, gap, 0.0)
    return found


@compiled
def surface_at(window: Window, x: float, y: float) -> tuple[float, float]:
    """Height [m] of the ground at (x, y) and its rise until the next update [m]; NaN over holes."""
    high, wide = window.heights.shape
    a, b, _, _, upper = triangle_weights(y / window.spacing, x / window.spacing, high, wide)
    facet = facet_of(window.heights, window.spacing, a, b, upper)
    if not is_ground(facet):
        return math.nan, 0.0
    rises = facet_of(window.rises, window.spacing, a, b, upper)
    return height_of(plane_of(facet), x, y), height_of(plane_of(rises), x, y)


@compiled
def nearest_planes(window: Window, candidates: Candidates) -> tuple[Plane, Plane]:
    """The plane of the nearest facet, and the plane of its rise until the next update."""
    heights = facet_of(window.heights, window.spacing, candidates.a, candidates.b, candidates.upper)
    rises = facet_of(window.rises, window.spacing, candidates.a, candidates.b, candidates.upper)
    return plane_of(heights), plane_of(rises)


@compiled
def nearest_in_box(solid: Solid, p: Point) -> Point:
    """The point nearest to ``p`` of the box around a solid, along the solid's axes."""
    own = in_frame(solid, p)
    x, y, z = solid.half.x + solid.rounding, solid.half.y + solid.rounding, solid.half.z + solid.rounding
    clamped = Point(min(max(own.x, -x), x), min(max(own.y, -y), y), min(max(own.z, -z), z))
    away = out_of_frame(solid, clamped)
    return Point(solid.centre.x + away.x, solid.centre.y + away.y, solid.centre.z + away.z)


@compiled
def fitted_slopes(sxx: float, sxy: float, syy: float, sxz: float, syz: float) -> tuple[bool, float, float]:
    """Least-squares slopes along x and y of the plane through points with these second moments about their mean. The
    first value is False if the points lie nearly along a line and determine no plane."""
    determinant = sxx * syy - sxy * sxy
    if determinant <= THIN * (sxx + syy) * (sxx + syy):
        return False, 0.0, 0.0
    return True, (sxz * syy - syz * sxy) / determinant, (syz * sxx - sxz * sxy) / determinant


@compiled
def fitted_planes(
    window: Window, solid: Solid, candidates: Candidates, marks: NDArray[np.uint8]
) -> tuple[Plane, Plane]:
    """Least-squares plane of the ground that a solid can touch, and the least-squares plane of its rise.

    Each candidate facet contributes one point: the ground below the point nearest to the facet's middle of the box
    around the solid. If these points determine no plane, the planes of the nearest facet are returned.
    """
    n = sx = sy = sz = sr = sxx = sxy = syy = sxz = syz = sxr = syr = 0.0
    x0, y0 = solid.centre.x, solid.centre.y
    for a in range(candidates.top, candidates.bottom + 1):
        for b in range(candidates.left, candidates.right + 1):
            for upper in range(2):
                if marks[a, b] & (1 + upper):
                    f = facet_of(window.heights, window.spacing, a, b, upper)
                    middle = Point((f.a.x + f.b.x + f.c.x) / 3.0, (f.a.y + f.b.y + f.c.y) / 3.0, f.a.z)
                    p = nearest_in_box(solid, middle)
                    z, rise = surface_at(window, p.x, p.y)
                    if not math.isnan(z):
                        x, y = p.x - x0, p.y - y0
                        n, sx, sy, sz, sr = n + 1.0, sx + x, sy + y, sz + z, sr + rise
                        sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
                        sxz, syz, sxr, syr = sxz + x * z, syz + y * z, sxr + x * rise, syr + y * rise
    if n < 3.0:
        return nearest_planes(window, candidates)
    sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    sxz, syz, sxr, syr = sxz - sx * sz / n, syz - sy * sz / n, sxr - sx * sr / n, syr - sy * sr / n
    known, slope_x, slope_y = fitted_slopes(sxx, sxy, syy, sxz, syz)
    if not known:
        return nearest_planes(window, candidates)
    _, rise_x, rise_y = fitted_slopes(sxx, sxy, syy, sxr, syr)
    x, y = x0 + sx / n, y0 + sy / n
    return (
        Plane(sz / n - slope_x * x - slope_y * y, slope_x, slope_y),
        Plane(sr / n - rise_x * x - rise_y * y, rise_x, rise_y),
    )


@compiled
def corner_drift(rises: Facet, rise: Plane) -> float:
    """Largest distance that a facet's corners move off a plane that rises by ``rise``, vertically [m]."""
    return max(
        abs(rises.a.z - height_of(rise, rises.a.x, rises.a.y)),
        abs(rises.b.z - height_of(rise, rises.b.x, rises.b.y)),
        abs(rises.c.z - height_of(rise, rises.c.x, rises.c.y)),
    )


@compiled
def on_plane(facet: Facet, plane: Plane) -> Facet:
    """A facet's corners projected vertically onto a plane."""
    a, b, c = facet.a, facet.b, facet.c
    return Facet(
        Point(a.x, a.y, height_of(plane, a.x, a.y)),
        Point(b.x, b.y, height_of(plane, b.x, b.y)),
        Point(c.x, c.y, height_of(plane, c.x, c.y)),
    )


@compiled
def plane_deviation(
    window: Window, solid: Solid, travel: Travel, candidates: Candidates, marks: NDArray[np.uint8], plane: Plane,
    rise: Plane, limit: float,
) -> float:  # fmt: skip
    """Bound on the vertical distance between a plane that rises by ``rise`` and the ground until the next update,
    wherever the solid can touch either [m].

    Infinite if the bound exceeds ``limit``, if the touchable part of the plane covers a hole, or if the solid's centre
    is below the plane.
    """
    high, wide = window.heights.shape
    normal = plane_normal(plane)
    if (solid.centre.z - height_of(plane, solid.centre.x, solid.centre.y)) * normal.z <= 0.0:
        return math.inf
    # The nearest facet, whose gap is known, often decides.
    nearest = facet_of(window.heights, window.spacing, candidates.a, candidates.b, candidates.upper)
    rises = facet_of(window.rises, window.spacing, candidates.a, candidates.b, candidates.upper)
    margin = max(margin_of(rises, travel), candidates.margin)
    if deviation_near(nearest, plane, solid, candidates.gap, margin) + corner_drift(rises, rise) > limit:
        return math.inf
    extent, most = extents(solid), max(largest_margin(window, travel), candidates.margin)
    half = 0.5 * window.spacing
    swing = (abs(plane.slope_x) + abs(plane.slope_y)) * half
    worst = 0.0
    for a in range(high - 1):
        for b in range(wide - 1):
            x, y = b * window.spacing, a * window.spacing
            middle = height_of(plane, x + half, y + half)
            if marks[a, b] == 0 and out_of_reach(
                solid, extent, x, y, window.spacing, middle - swing, middle + swing, most
            ):
                continue
            for upper in range(2):
                facet = facet_of(window.heights, window.spacing, a, b, upper)
                flat = on_plane(facet, plane)
                if not is_ground(facet):
                    if gap_to(flat, solid, candidates.margin).distance <= candidates.margin:
                        return math.inf
                    continue
                rises = facet_of(window.rises, window.spacing, a, b, upper)
                drift = corner_drift(rises, rise)
                off = max(abs(facet.a.z - flat.a.z), abs(facet.b.z - flat.b.z), abs(facet.c.z - flat.c.z)) + drift
                if off <= worst:
                    continue
                margin = max(margin_of(rises, travel), candidates.margin)
                bound = 0.0
                if marks[a, b] & (1 + upper):
                    bound = deviation_near(facet, plane, solid, gap_to(facet, solid, margin), margin) + drift
                gap = gap_to(flat, solid, margin)
                if gap.distance <= margin:
                    bound = max(bound, deviation_near(facet, plane, solid, gap, margin) + drift)
                worst = max(worst, min(bound, off))
                if worst > limit:
                    return math.inf
    return worst
