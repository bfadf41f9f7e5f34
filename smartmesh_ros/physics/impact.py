"""Time of impact of a moving solid with the ground, and its height at rest, by conservative advancement on the nearest
facet.

A solid can advance along the normal of a facet by the gap between them without touching it. Repeated advances converge
to the surface (Mirtich, *Impulse-based Dynamic Simulation of Rigid Body Systems*, 1996, 2.3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.contact_candidates import (
    UP,
    Travel,
    Window,
    facet_of,
    heights_of_cell,
    highest,
    is_ground,
    out_of_reach,
    surface_at,
)
from smartmesh_ros.patches.facets import Point, along, dot, minus, scaled
from smartmesh_ros.patches.gaps import Gap, gap_to
from smartmesh_ros.patches.rotations import product
from smartmesh_ros.patches.selection import in_window, local_body, window_place
from smartmesh_ros.patches.shapes import solid_of
from smartmesh_ros.patches.solids import Solid, extents, moved_by
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.moving_grid import read_window

# Largest number of advances; a solid that is still grazing the ground then counts as a miss.
ADVANCES = 64
# Gap below which a solid touches the ground [m].
TOUCH = 1e-5
# Number of corrections of a clamped solid towards the ground after the step, and the largest gap to correct [m].
REFINEMENTS, NEARBY = 2, 0.02


class Impact(NamedTuple):
    """First contact of a solid on its path: ``share`` of the path (0 to 1, 2 = no contact); remaining ``gap`` [m];
    ``normal`` from the ground to the solid."""

    share: float
    gap: float
    normal: Point


@compiled
def first_gap(
    window: Window, solid: Solid, path: Point, least: float, limit: float, by_share: bool
) -> tuple[float, Gap]:
    """Return the smallest gap below ``limit`` to a facet that a solid closes on by more than ``least`` [m] along its
    path, and the value compared.

    The value is the distance [m], or with ``by_share`` the share of the path after which the gap may be closed; it is
    ``limit`` if there is no such facet. Only motion along a gap's normal can close it, because the plane across the
    normal separates facet and solid.
    """
    high, wide = window.heights.shape
    extent, z = extents(solid), window.heights
    length = math.sqrt(dot(path, path)) if by_share else 1.0
    best = Gap(math.inf, UP, solid.centre)
    for a in range(high - 1):
        for b in range(wide - 1):
            low, top = heights_of_cell(z, a, b)
            margin = max(limit, 0.0) * length + TOUCH
            if out_of_reach(solid, extent, b * window.spacing, a * window.spacing, window.spacing, low, top, margin):
                continue
            for upper in range(2):
                facet = facet_of(z, window.spacing, a, b, upper)
                if is_ground(facet):
                    gap = gap_to(facet, solid, margin)
                    closing = -dot(gap.normal, path)
                    unit = closing if by_share else 1.0
                    if closing > least and gap.distance < limit * unit:
                        limit, best = gap.distance / unit, gap
    return limit, best


@compiled
def nearest_gap(window: Window, solid: Solid, path: Point, least: float, reach: float) -> Gap:
    """Return the gap to the nearest facet within ``reach`` [m] that a solid closes on by more than ``least`` [m] along
    its path; infinite if there is none."""
    return first_gap(window, solid, path, least, reach, False)[1]


@compiled
def time_of_impact(window: Window, solid: Solid, path: Point, least: float) -> Impact:
    """Return the first contact of a solid with a facet of the ground that it closes on by more than ``least`` [m] along
    its path."""
    share = 0.0
    for _ in range(ADVANCES):
        advance, gap = first_gap(window, moved_by(solid, path, share), path, least, 1.0 - share, True)
        if gap.distance <= TOUCH:
            return Impact(share, gap.distance, gap.normal)
        share += advance
        if share >= 1.0:
            break
    return Impact(2.0, math.inf, UP)


@compiled
def clamped_path(window: Window, solid: Solid, path: Point, least: float, arrival: float) -> Point:
    """Return the path of a solid that arrives at the ground, ``arrival`` [m] deep, and then slides along it; unchanged
    if the solid touches nothing."""
    first = time_of_impact(window, solid, path, least)
    if first.share >= 1.0:
        return path
    closing = -(1.0 - first.share) * dot(first.normal, path)
    if closing - first.gap <= least:
        return path
    # Start off the facet by more than TOUCH, so that coplanar neighbours do not count as contacts.
    start = along(scaled(path, first.share), 2.0 * TOUCH - first.gap, first.normal)
    rest = along(scaled(path, 1.0 - first.share), closing, first.normal)
    second = time_of_impact(window, moved_by(solid, start, 1.0), rest, least)
    if second.share < 1.0:
        return along(scaled(path, first.share), second.share, rest)
    return along(path, closing - first.gap - arrival, first.normal)


@compiled
def without_closing(path: Point, contacts: FloatArray, cos: float, sin: float) -> Point:
    """Remove from a path the components that close on ``contacts`` (n, 4), because the solver removes them. A contact
    has its unit normal, and the displacement along it that the body's rotation causes there [m]. ``cos``, ``sin``:
    rotation of the path's frame about z."""
    for n in range(len(contacts)):
        x, y = contacts[n, 0], contacts[n, 1]
        normal = Point(x * cos + y * sin, y * cos - x * sin, contacts[n, 2])
        closing = -dot(normal, path) - contacts[n, 3]
        if closing > 0.0:
            path = along(path, closing, normal)
    return path


@compiled
def out_of_ground(window: Window, solid: Solid) -> Solid:
    """Move a solid in contact along the contact's normal until it just touches, because the ground beside a penetrating
    contact would block its path."""
    gap = nearest_gap(window, solid, UP, -math.inf, 0.0)
    return moved_by(solid, gap.normal, 2.0 * TOUCH - gap.distance) if gap.distance < 0.0 else solid


@compiled
def to_arrival(window: Window, solid: Solid, arrival: float) -> Point:
    """Return the displacement that puts a solid near the ground ``arrival`` [m] deep into it."""
    moved = Point(0.0, 0.0, 0.0)
    for _ in range(REFINEMENTS):
        gap = nearest_gap(window, moved_by(solid, moved, 1.0), Point(0.0, 0.0, -1.0), 0.0, NEARBY)
        if gap.distance > NEARBY:
            break
        moved = along(moved, -arrival - gap.distance, gap.normal)
    return moved


@compiled
def spin(body, dt):
    """Rotate a body (13,) by its angular velocity for a time ``dt`` [s]."""
    x, y, z = body[10], body[11], body[12]
    rate = math.sqrt(x * x + y * y + z * z)
    if rate > 0.0:
        sine = math.sin(0.5 * rate * dt) / rate
        turn = (sine * x, sine * y, sine * z, math.cos(0.5 * rate * dt))
        body[3], body[4], body[5], body[6] = product(turn, (body[3], body[4], body[5], body[6]))


@compiled
def window_about(grid, solid, travel, time, dt, rules, memory_h, memory_r):
    """Read the ground that a solid can reach at ``time`` [s], with its rise in ``dt`` [s]; returns the window's place,
    and the window in the given memory."""
    place = window_place(grid.resolution, solid, travel, rules)
    heights, rises = memory_h[: place.high, : place.wide], memory_r[: place.high, : place.wide]
    read_window(grid, place.row, place.column, place.stride, time, dt, heights, rises)
    return place, Window(heights, rises, grid.resolution * place.stride)


@compiled
def clamp_before_impact(
    grid, shapes, slot, body, time, dt, fall, least, arrival, contacts, rules, memory_h, memory_r, change
):  # fmt: skip
    """Write the ``change`` (3,) of velocity [m/s] by which a body (13,) arrives at the ground's surface in the step of
    ``dt`` [s] from ``time`` [s], instead of penetrating it. Returns True if the change is not zero.

    ``fall`` (3,) [m/s]: velocity that gravity adds in the step. ``contacts`` (n, 4): contacts of the body with its
    collider, as in `without_closing`. The solver stops the body at these contacts, so only the rest of its path is
    clamped.
    """
    local = np.empty(13)
    local_body(grid, body, local)
    solid = solid_of(shapes, slot, local)
    fall_x, fall_y = fall[0] * grid.cos + fall[1] * grid.sin, fall[1] * grid.cos - fall[0] * grid.sin
    path = Point((local[7] + fall_x) * dt, (local[8] + fall_y) * dt, (local[9] + fall[2]) * dt)
    travel = Travel(path.x, path.y, path.z, arrival)
    place, window = window_about(grid, solid, travel, time, dt, rules, memory_h, memory_r)
    own = in_window(grid, place, solid)
    _, rise = surface_at(window, own.centre.x, own.centre.y)
    whole = Point(path.x, path.y, path.z - rise)
    relative = without_closing(whole, contacts, grid.cos, grid.sin)
    held = relative != whole
    start = out_of_ground(window, own) if held else own
    clamped = clamped_path(window, start, relative, least, arrival)
    cut = minus(clamped, relative)
    if cut.x == 0.0 and cut.y == 0.0 and cut.z == 0.0:
        return False
    if not held:
        window.heights[:] += window.rises
        for axis in range(3):
            local[axis] += (path.x, path.y, path.z)[axis]
        spin(local, dt)
        after = in_window(grid, place, solid_of(shapes, slot, local))
        cut = along(cut, 1.0, to_arrival(window, moved_by(after, cut, 1.0), arrival))
    x, y = cut.x / dt, cut.y / dt
    change[0], change[1], change[2] = x * grid.cos - y * grid.sin, x * grid.sin + y * grid.cos, cut.z / dt
    return True


@compiled
def height_at_rest(grid, shapes, slot, body, time, rules, memory_h, memory_r):
    """Return the lift [m] with which a body (13,) lies on the ground in its current orientation; NaN if there is no
    ground under it. The body is lowered from above until it touches."""
    local = np.empty(13)
    local_body(grid, body, local)
    solid = solid_of(shapes, slot, local)
    still = Travel(0.0, 0.0, 0.0, 0.0)
    place, window = window_about(grid, solid, still, time, 0.0, rules, memory_h, memory_r)
    own = in_window(grid, place, solid)
    top = highest(window)
    if top == -math.inf:
        return math.nan
    start = top + extents(own).z
    raised = moved_by(own, Point(0.0, 0.0, start - own.centre.z), 1.0)
    down = Point(0.0, 0.0, -1.0)
    for _ in range(4 * ADVANCES):
        gap = nearest_gap(window, raised, down, 0.0, math.inf)
        if gap.distance <= TOUCH:
            break
        if gap.distance == math.inf:
            return math.nan
        raised = moved_by(raised, Point(0.0, 0.0, -gap.distance), 1.0)
    return raised.centre.z - own.centre.z
