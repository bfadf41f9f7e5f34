"""One compiled pass that selects, for each body, exactly the ground that it can touch until the next update."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.buried import candidate_above, candidate_below, is_buried
from smartmesh_ros.patches.contact_candidates import (
    Candidates,
    Travel,
    Window,
    candidate_facets,
    fitted_planes,
    nearest_planes,
    plane_deviation,
)
from smartmesh_ros.patches.facets import Plane, Point, cross, dot, height_of, plane_normal
from smartmesh_ros.patches.rectangles import Rectangle, smallest_rectangle
from smartmesh_ros.patches.rotations import product
from smartmesh_ros.patches.shapes import Shapes, solid_of
from smartmesh_ros.patches.solids import ShapeKind, Solid, extents, is_round, moved_by
from smartmesh_ros.patches.supports import Support
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.moving_grid import MovingGrid, read_window, slide_at, to_grid


class Rules(NamedTuple):
    """`SelectionConfig` and the user's patch settings for compiled functions.

    ``tolerance`` [m]; ``hysteresis``, ``leave``, ``most_cells``, ``most_samples``, ``fastest``: see `SelectionConfig`;
    ``planes``: try planes; ``any_plane``: accept a plane of any deviation; ``always``: give bodies near the ground a
    field even if they can touch nothing; ``gravity`` [m/s^2]; ``across``: mark bodies whose window leaves the map as
    ACROSS, to be chosen from the samples of several tiles.
    """

    tolerance: float
    hysteresis: float
    leave: float
    planes: bool
    any_plane: bool
    always: bool
    most_cells: int
    most_samples: int
    fastest: float
    gravity: float
    across: bool


class Place(NamedTuple):
    """Position of a window on its map: first sample, number of samples on its sides, and the stride between them."""

    row: int
    column: int
    high: int
    wide: int
    stride: int


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
def acceleration_by_turning(grid: MovingGrid, body: FloatArray) -> float:
    """Bound on the apparent acceleration [m/s^2] of a free body (13,) in the frame of a rotating grid."""
    if grid.spin == 0.0:
        return 0.0
    slide_x, slide_y = slide_at(grid, body[0], body[1])
    speed, slide = math.sqrt(body[7] * body[7] + body[8] * body[8]), math.sqrt(slide_x * slide_x + slide_y * slide_y)
    return abs(grid.spin) * (2.0 * speed + slide)


@compiled
def swing_of(body: FloatArray, solid: Solid, duration: float) -> float:
    """Bound on the motion of a solid's surface in a ``duration`` [s] by the spin of its body (13,) [m].

    The spin carries the solid's centre around, and turns the solid about it. A turn of a body of revolution about its
    own axis moves no surface, so only the turn of the axis counts.
    """
    spin = Point(body[10], body[11], body[12])
    away = Point(solid.centre.x - body[0], solid.centre.y - body[1], solid.centre.z - body[2])
    carried = cross(spin, away)
    arc = min(math.sqrt(dot(carried, carried)) * duration, 2.0 * math.sqrt(dot(away, away)))
    if solid.kind == ShapeKind.BALL:
        return arc
    turning = cross(spin, solid.w) if is_round(solid.kind) else spin
    return arc + min(math.sqrt(dot(turning, turning)) * duration, 2.0) * solid.reach


@compiled
def travel_of(body: FloatArray, solid: Solid, duration: float, rules: Rules, bend: float = 0.0) -> Travel:
    """Predicted motion of a solid on a body (13,) in a ``duration`` [s], from the body's velocity, spin and fall, and
    from ``bend`` [m/s^2], the apparent acceleration in a rotating grid."""
    speed = math.sqrt(body[7] * body[7] + body[8] * body[8] + body[9] * body[9])
    share = duration if speed <= rules.fastest else duration * rules.fastest / speed
    fall = 0.5 * (rules.gravity + bend) * duration * duration
    return Travel(body[7] * share, body[8] * share, body[9] * share, fall + swing_of(body, solid, duration))


@compiled
def window_place(resolution: float, solid: Solid, travel: Travel, rules: Rules) -> Place:
    """Return the window of samples that a solid can reach."""
    extent = extents(solid)
    reach_x = extent.x + abs(travel.x) + travel.more + rules.leave
    reach_y = extent.y + abs(travel.y) + travel.more + rules.leave
    row = math.floor((solid.centre.y - reach_y) / resolution)
    column = math.floor((solid.centre.x - reach_x) / resolution)
    high = math.ceil((solid.centre.y + reach_y) / resolution) + 1 - row
    wide = math.ceil((solid.centre.x + reach_x) / resolution) + 1 - column
    stride = (max(high, wide) - 1) // rules.most_samples + 1
    return Place(row, column, (high - 2) // stride + 2, (wide - 2) // stride + 2, stride)


@compiled
def select(grid, tile, shapes, bodies, chosen, duration, time, rules, supports, heights, rises, marks):
    """Choose the supports of the bodies in ``chosen`` (n,) on a tile, for ``duration`` [s] from ``time`` [s] on.

    ``shapes``: `Shapes` of N slots; ``bodies`` (N, 13); ``supports`` (N,): records of ``SUPPORT``, read and
    written. ``heights``, ``rises``, ``marks``: scratch memory for windows (S, S).
    """
    local = np.empty(13)
    for k in range(len(chosen)):
        i = chosen[k]
        supports[i].tile, supports[i].first = tile, -1
        if not is_finite(bodies[i]):
            supports[i].state = Support.NONE
            continue
        local_body(grid, bodies[i], local)
        solid = solid_of(shapes, i, local)
        travel = travel_of(local, solid, duration, rules, acceleration_by_turning(grid, bodies[i]))
        place = window_place(grid.resolution, solid, travel, rules)
        if rules.across and leaves_map(grid, place):
            supports[i].state = Support.ACROSS
            continue
        h, r = heights[: place.high, : place.wide], rises[: place.high, : place.wide]
        read_window(grid, place.row, place.column, place.stride, time, duration, h, r)
        choose(grid, place, h, r, solid, travel, duration, rules, supports[i], marks)


@compiled
def is_finite(body: FloatArray) -> bool:
    """Return True if all numbers of a body (13,) are finite."""
    total = 0.0
    for k in range(13):
        total += body[k]
    return math.isfinite(total)


@compiled
def leaves_map(grid: MovingGrid, place: Place) -> bool:
    """Return True if a window has samples beyond the map's edge."""
    rows, columns = grid.heights.shape
    last_row = place.row + (place.high - 1) * place.stride
    last_column = place.column + (place.wide - 1) * place.stride
    return place.row < 0 or place.column < 0 or last_row >= rows or last_column >= columns


@compiled
def predicted(grid: MovingGrid, shapes: Shapes, slot: int, body: FloatArray, duration: float, rules: Rules):
    """Return the solid of a body (13,) in the frame of the grid, and its travel."""
    local = np.empty(13)
    local_body(grid, body, local)
    solid = solid_of(shapes, slot, local)
    return solid, travel_of(local, solid, duration, rules, acceleration_by_turning(grid, body))


@compiled
def select_across(grid, place, heights, rises, shapes, slot, body, duration, rules, support, marks):
    """Choose the support of one body from a window (h, w) at ``place`` that was read from several tiles."""
    solid, travel = predicted(grid, shapes, slot, body, duration, rules)
    h, r = heights[: place.high, : place.wide], rises[: place.high, : place.wide]  # slices: the array type of `select`
    choose(grid, place, h, r, solid, travel, duration, rules, support[0], marks)


@compiled
def window_of(grid, shapes, slot, body, duration, rules):
    """Return the place of a body's window on the grid."""
    solid, travel = predicted(grid, shapes, slot, body, duration, rules)
    return window_place(grid.resolution, solid, travel, rules)


@compiled
def in_window(grid: MovingGrid, place: Place, solid: Solid) -> Solid:
    """A solid of the grid's frame, relative to the first sample of a window."""
    return moved_by(solid, Point(place.column * grid.resolution, place.row * grid.resolution, 0.0), -1.0)


@compiled
def choose(grid, place, heights, rises, solid, travel, duration, rules, support, marks):
    """Choose the support of one solid from a window of samples."""
    before = support.state
    spacing = grid.resolution * place.stride
    own = in_window(grid, place, solid)
    window = Window(heights, rises, spacing)
    leave = rules.leave if before != Support.NONE else 0.0
    travel = Travel(travel.x, travel.y, travel.z, travel.more + leave)
    support.margin = math.sqrt(travel.x * travel.x + travel.y * travel.y + travel.z * travel.z) + travel.more
    candidates = candidate_facets(window, own, travel, marks)
    if candidates.facets == 0:
        candidates = candidate_below(window, own, candidates)
        if not rules.always or candidates.facets == 0:
            support.state, support.gap, support.deviation = Support.NONE, math.inf, math.nan
            return
    buried = rules.planes and is_buried(window, own)
    if buried:
        candidates = candidate_above(window, own, candidates)
    if own.kind == ShapeKind.BALL or buried:
        plane, rise = nearest_planes(window, candidates)
    else:
        plane, rise = fitted_planes(window, own, candidates, marks)
    deviation = math.inf
    if buried:
        deviation = math.nan
    elif rules.planes:
        limit = rules.tolerance if before == Support.PLANE else rules.hysteresis * rules.tolerance
        deviation = plane_deviation(
            window, own, travel, candidates, marks, plane, rise, math.inf if rules.any_plane else limit
        )
        if rules.any_plane and not deviation < math.inf:
            deviation = math.nan
    support.state = Support.FIELD if deviation == math.inf else Support.PLANE
    rectangle = rectangle_of(grid, place, window, candidates, rules, support, before)
    stride = rectangle.stride * place.stride
    support.row, support.column = (
        place.row + rectangle.row * place.stride,
        place.column + rectangle.column * place.stride,
    )
    support.rows, support.columns, support.stride = rectangle.high + 1, rectangle.wide + 1, stride
    if support.state == Support.PLANE:
        support.deviation = deviation
    else:
        support.deviation = rectangle.deviation if place.stride == 1 else math.nan
    support.gap, support.margin = candidates.gap.distance, max(support.margin, candidates.margin)
    describe(grid, place, own, candidates, plane, rise, duration, support)


@compiled
def rectangle_of(grid, place, window, candidates, rules, support, before):
    """Return the rectangle of a field; for a plane, a rectangle of 2 x 2 coarse cells over the candidates."""
    rows, columns = grid.heights.shape
    bounds = (-place.row, rows - 1 - place.row, -place.column, columns - 1 - place.column)
    if rules.across:
        far = 1 << 40
        bounds = (-far, far, -far, far)
    if place.stride > 1:
        bounds = (0, window.heights.shape[0] - 1, 0, window.heights.shape[1] - 1)
    if support.state == Support.PLANE:
        need = max(candidates.bottom - candidates.top, candidates.right - candidates.left) + 1
        stride = (need + 1) // 2
        row = max(min(candidates.top, bounds[1] - 2 * stride), bounds[0])
        column = max(min(candidates.left, bounds[3] - 2 * stride), bounds[2])
        return Rectangle(row, column, 2, 2, stride, 0.0)
    had = Rectangle(0, 0, 0, 0, 1, math.inf)
    if before == Support.FIELD and support.stride % place.stride == 0:
        stride = support.stride // place.stride
        high, wide = support.rows - 1, support.columns - 1
        aligned = (support.row - place.row) % place.stride == 0 and (support.column - place.column) % place.stride == 0
        row, column = (support.row - place.row) // place.stride, (support.column - place.column) // place.stride
        had = Rectangle(row if aligned else -(1 << 40), column, high, wide, stride, math.inf)
    return smallest_rectangle(window, candidates, had, rules.tolerance, rules.most_cells, bounds)


@compiled
def describe(
    grid: MovingGrid,
    place: Place,
    solid: Solid,
    candidates: Candidates,
    plane: Plane,
    rise: Plane,
    duration: float,
    support,
) -> None:
    """Write the foot, the normals and the motion of the ground under a solid, in the terrain's frame."""
    facet = plane_normal(plane)
    if solid.kind == ShapeKind.BALL and candidates.gap.distance < math.inf:
        foot = candidates.gap.nearest
    else:
        above = (solid.centre.z - height_of(plane, solid.centre.x, solid.centre.y)) * facet.z
        foot = Point(
            solid.centre.x - above * facet.x, solid.centre.y - above * facet.y, solid.centre.z - above * facet.z
        )
    normal = candidates.gap.normal
    cos, sin = grid.cos, grid.sin
    x, y = foot.x + place.column * grid.resolution, foot.y + place.row * grid.resolution
    support.foot_x, support.foot_y, support.foot_z = grid.x + x * cos - y * sin, grid.y + x * sin + y * cos, foot.z
    support.normal_x, support.normal_y = normal.x * cos - normal.y * sin, normal.x * sin + normal.y * cos
    support.normal_z = normal.z
    support.facet_x, support.facet_y = facet.x * cos - facet.y * sin, facet.x * sin + facet.y * cos
    support.facet_z = facet.z
    inverse = 1.0 / duration
    support.rise = height_of(rise, foot.x, foot.y) * inverse
    # A point (x, y) of ground with angular velocity w rises at w_x y - w_y x.
    turn_x, turn_y = rise.slope_y * inverse, -rise.slope_x * inverse
    support.turn_x, support.turn_y = turn_x * cos - turn_y * sin, turn_x * sin + turn_y * cos
    support.slide_x, support.slide_y = slide_at(grid, support.foot_x, support.foot_y)
    support.turn_z = grid.spin


WindowMemory = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]


def window_memory(samples: int) -> WindowMemory:
    """Allocate scratch memory for windows of ``samples`` x ``samples``: heights, rises, and marks of candidate
    facets."""
    return np.empty((samples, samples)), np.empty((samples, samples)), np.zeros((samples, samples), np.uint8)
