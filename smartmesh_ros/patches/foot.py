"""The foot of a body: the point of the ground nearest to it, with the ground's normal and motion there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.facets import Facet, Plane, Point, dot, height_of, minus, plane_normal, plane_of
from smartmesh_ros.patches.gaps import Gap, gap_to
from smartmesh_ros.patches.rotations import product
from smartmesh_ros.patches.solids import ShapeKind, Solid, moved_by
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.moving_grid import MovingGrid, slide_at, to_grid

# Weight of a facet's distance to the solid's centre in the choice of the nearest facet [-]; breaks ties between gaps.
TIE = 1e-6
UP = Point(0.0, 0.0, 1.0)


class Place(NamedTuple):
    """Position of a window on its map: first sample, number of samples on its sides, and the stride between them."""

    row: int
    column: int
    high: int
    wide: int
    stride: int


class Window(NamedTuple):
    """Samples (h, w): ``heights`` now [m], and ``rises``, their change until the next update [m]. Sample (a, b) is at x
    = b ``spacing``, y = a ``spacing`` [m]; NaN = no ground."""

    heights: FloatArray
    rises: FloatArray
    spacing: float


class Nearest(NamedTuple):
    """The facet of a window nearest to a solid: cell ``a``, ``b``, the ``upper`` one of its two, and its ``gap``, which
    is infinite if the window has no ground."""

    a: int
    b: int
    upper: int
    gap: Gap


@compiled
def local_body(grid: MovingGrid, body: FloatArray, out: FloatArray) -> None:
    """Write a body (13,) to ``out`` in the moving frame of the grid: x along columns, y along rows, origin at sample
    (0, 0) and z = 0."""
    row, column = to_grid(grid, body[0], body[1])
    out[0], out[1], out[2] = column * grid.resolution, row * grid.resolution, body[2]
    half = 0.5 * math.atan2(grid.sin, grid.cos)
    turn = product((0.0, 0.0, -math.sin(half), math.cos(half)), (body[3], body[4], body[5], body[6]))
    out[3], out[4], out[5], out[6] = turn
    for first in (7, 10):
        x, y = body[first], body[first + 1]
        out[first], out[first + 1] = x * grid.cos + y * grid.sin, y * grid.cos - x * grid.sin
        out[first + 2] = body[first + 2]
    slide_x, slide_y = slide_at(grid, body[0], body[1])
    out[7] -= slide_x * grid.cos + slide_y * grid.sin
    out[8] -= slide_y * grid.cos - slide_x * grid.sin
    out[12] -= grid.spin


@compiled
def in_window(grid: MovingGrid, place: Place, solid: Solid) -> Solid:
    """A solid of the grid's frame, relative to the first sample of a window."""
    return moved_by(solid, Point(place.column * grid.resolution, place.row * grid.resolution, 0.0), -1.0)


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
def rank_of(gap: Gap, solid: Solid) -> float:
    """Return the rank of a gap, smallest for the nearest facet: its distance, and a little of that to the centre."""
    away = minus(gap.nearest, solid.centre)
    return gap.distance + TIE * math.sqrt(dot(away, away))


@compiled
def nearest_facet(window: Window, solid: Solid) -> Nearest:
    """Return the facet nearest to a solid."""
    high, wide = window.heights.shape
    found, best = Nearest(0, 0, 0, Gap(math.inf, UP, solid.centre)), math.inf
    for a in range(high - 1):
        for b in range(wide - 1):
            for upper in range(2):
                facet = facet_of(window.heights, window.spacing, a, b, upper)
                if not is_ground(facet):
                    continue
                gap = gap_to(facet, solid, best)
                rank = rank_of(gap, solid)
                if rank < best:
                    best, found = rank, Nearest(a, b, upper, gap)
    return found


@compiled
def nearest_planes(window: Window, nearest: Nearest) -> tuple[Plane, Plane]:
    """The plane of the nearest facet, and the plane of its rise until the next update."""
    heights = facet_of(window.heights, window.spacing, nearest.a, nearest.b, nearest.upper)
    rises = facet_of(window.rises, window.spacing, nearest.a, nearest.b, nearest.upper)
    return plane_of(heights), plane_of(rises)


@compiled
def describe(
    grid: MovingGrid, place: Place, window: Window, solid: Solid, nearest: Nearest, duration: float, support: Any
) -> None:
    """Write the foot, the normals and the motion of the ground under a solid, in the terrain's frame."""
    plane, rise = nearest_planes(window, nearest)
    facet = plane_normal(plane)
    if solid.kind == ShapeKind.BALL:
        foot = nearest.gap.nearest
    else:
        above = (solid.centre.z - height_of(plane, solid.centre.x, solid.centre.y)) * facet.z
        foot = Point(
            solid.centre.x - above * facet.x, solid.centre.y - above * facet.y, solid.centre.z - above * facet.z
        )
    cos, sin = grid.cos, grid.sin
    x, y = foot.x + place.column * grid.resolution, foot.y + place.row * grid.resolution
    support.gap = nearest.gap.distance
    support.foot_x, support.foot_y, support.foot_z = grid.x + x * cos - y * sin, grid.y + x * sin + y * cos, foot.z
    support.facet_x, support.facet_y = facet.x * cos - facet.y * sin, facet.x * sin + facet.y * cos
    support.facet_z = facet.z
    inverse = 1.0 / duration
    support.rise = height_of(rise, foot.x, foot.y) * inverse
    # A point (x, y) of ground with angular velocity w rises at w_x y - w_y x.
    turn_x, turn_y = rise.slope_y * inverse, -rise.slope_x * inverse
    support.turn_x, support.turn_y = turn_x * cos - turn_y * sin, turn_x * sin + turn_y * cos
    support.slide_x, support.slide_y = slide_at(grid, support.foot_x, support.foot_y)
    support.turn_z = grid.spin
