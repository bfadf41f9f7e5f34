"""Undersides of the bodies that press the soil: boxes, spheres, cylinders and capsules.

All functions take coordinates relative to the shape's middle, in axes of the grid (x along columns, y along rows), and
the rows of the shape's rotation (3, 3) from its own axes to those. Tuples of numbers are faster here than arrays, which
compiled functions count references to.
"""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import FloatArray

Triple = tuple[float, float, float]
Rotation = tuple[Triple, Triple, Triple]

# Kinds of shape, numbered as in smartmesh_msgs/TrackedBody.
BOX, SPHERE, CYLINDER, CAPSULE = 1, 2, 3, 4

# A body that presses the soil. ``form``: kind of its shape; half lengths x, y, z of a BOX, else radius, radius, half
# height [m]; position [m] and quaternion of the shape in the body's frame. ``state``: position, quaternion, linear and
# angular velocity of the body's frame in the world. ``force`` [N]: vertical contact force of the last update, at the
# distance ``place`` (2,) [m] from the body's position along x and y of the world, NaN = unknown; ``load`` [N],
# ``centre_of_load`` (2,): the same, filtered. ``seat`` [m]: height of the shape's middle without the map's z, at which
# the soil carries the load; ``slope`` (2,): of the pressed plane, along columns and rows. ``first``, ``last``: row and
# column of the samples it pressed last, ``first`` > ``last`` = none; ``seen_first``, ``seen_last``: rectangle around
# these samples that the next update must look at. Results: ``sinkage`` [m], the deepest; ``area`` [m^2]; ``carried``
# [N], by the soil's pressure; ``grip``, shear force over pressing force; ``displaced`` [m^3], in the last update.
FOOT = np.dtype(
    (
        np.record,
        [
            ("form", np.float64, 11), ("state", np.float64, 13), ("force", np.float64), ("place", np.float64, 2),
            ("load", np.float64), ("centre_of_load", np.float64, 2), ("seat", np.float64), ("slope", np.float64, 2),
            ("first", np.int64, 2), ("last", np.int64, 2), ("seen_first", np.int64, 2), ("seen_last", np.int64, 2),
            ("sinkage", np.float64), ("area", np.float64), ("carried", np.float64), ("grip", np.float64),
            ("displaced", np.float64),
        ],
    )
)  # fmt: skip


@compiled
def interval_in(start: float, slope: float, half: float) -> tuple[float, float]:
    """Return the range of t in which |start + slope t| <= half; empty (inf, -inf) if there is none."""
    if abs(slope) < 1e-9:
        return (-math.inf, math.inf) if abs(start) <= half else (math.inf, -math.inf)
    a, b = (-half - start) / slope, (half - start) / slope
    return min(a, b), max(a, b)


@compiled
def vertical_axis(rotation: Rotation) -> int:
    """Return which axis of a shape is the most vertical."""
    x, y, z = abs(rotation[2][0]), abs(rotation[2][1]), abs(rotation[2][2])
    return 2 if z >= x and z >= y else (0 if x >= y else 1)


@compiled
def margin_along(rotation: Rotation, axis: int, spacing: float) -> float:
    """Return the farthest distance along an axis of a corner of a grid cell that the shape's edge touches [m]."""
    return spacing * (abs(rotation[0][axis]) + abs(rotation[1][axis]))


@compiled
def underside(kind: int, half: Triple, rotation: Rotation, x: float, y: float, spacing: float) -> float:
    """Return the height of the shape's underside at (x, y) [m], infinity beside it.

    Flat faces extend beyond the shape's edge by up to a cell of the grid, because the corners of all cells that the
    shape touches must go down with it: between samples the ground is interpolated.
    """
    if kind == SPHERE:
        return sphere_underside(half[0], x, y)
    if kind == BOX:
        return box_underside(half, rotation, x, y, spacing)
    if kind == CYLINDER:
        return cylinder_underside(half[0], half[2], rotation, x, y, spacing)
    low = cylinder_underside(half[0], half[2], rotation, x, y, 0.0)
    for side in (-half[2], half[2]):
        ux, uy, uz = side * rotation[0][2], side * rotation[1][2], side * rotation[2][2]
        low = min(low, uz + sphere_underside(half[0], x - ux, y - uy))
    return low


@compiled
def normal_at(kind: int, half: Triple, rotation: Rotation, x: float, y: float, z: float, spacing: float) -> Triple:
    """Return the unit normal, of either sign, of the shape's underside at a point (x, y, z) on it [m]."""
    if kind == BOX:
        upright, face, farthest = vertical_axis(rotation), 0, -1.0
        for axis in range(3):
            size = half[axis] if axis == upright else half[axis] + margin_along(rotation, axis, spacing)
            out = abs(rotation[0][axis] * x + rotation[1][axis] * y + rotation[2][axis] * z) / size
            if out > farthest:
                face, farthest = axis, out
        return rotation[0][face], rotation[1][face], rotation[2][face]
    along = 0.0 if kind == SPHERE else rotation[0][2] * x + rotation[1][2] * y + rotation[2][2] * z
    if kind == CYLINDER:
        size = half[2] if vertical_axis(rotation) == 2 else half[2] + margin_along(rotation, 2, spacing)
        if abs(along) > (1.0 - 1e-6) * size:  # on a flat end
            return rotation[0][2], rotation[1][2], rotation[2][2]
    elif kind == CAPSULE:
        along = min(max(along, -half[2]), half[2])
    out_x, out_y, out_z = x - along * rotation[0][2], y - along * rotation[1][2], z - along * rotation[2][2]
    length = math.sqrt(out_x * out_x + out_y * out_y + out_z * out_z)
    return out_x / length, out_y / length, out_z / length


@compiled
def sphere_underside(radius: float, x: float, y: float) -> float:
    """Return the underside of a sphere at (x, y) [m]."""
    left = radius * radius - x * x - y * y
    return -math.sqrt(left) if left > 0.0 else math.inf


@compiled
def box_underside(half: Triple, rotation: Rotation, x: float, y: float, spacing: float) -> float:
    """Return the underside of a box at (x, y) [m]: where a vertical line enters its three slabs."""
    upright = vertical_axis(rotation)
    low, high = -math.inf, math.inf
    for axis in range(3):
        size = half[axis] if axis == upright else half[axis] + margin_along(rotation, axis, spacing)
        enter, leave = interval_in(rotation[0][axis] * x + rotation[1][axis] * y, rotation[2][axis], size)
        low, high = max(low, enter), min(high, leave)
    return low if low <= high else math.inf


@compiled
def cylinder_underside(
    radius: float, half_height: float, rotation: Rotation, x: float, y: float, spacing: float
) -> float:
    """Return the underside of a cylinder about its own z axis at (x, y) [m]."""
    standing = vertical_axis(rotation) == 2
    if standing:
        radius += math.sqrt(2.0) * spacing
    else:
        half_height += margin_along(rotation, 2, spacing)
    px, py = rotation[0][0] * x + rotation[1][0] * y, rotation[0][1] * x + rotation[1][1] * y
    dx, dy = rotation[2][0], rotation[2][1]
    a, b, c = dx * dx + dy * dy, px * dx + py * dy, px * px + py * py - radius * radius
    low, high = interval_in(rotation[0][2] * x + rotation[1][2] * y, rotation[2][2], half_height)
    if a < 1e-12:
        return low if c <= 0.0 and low <= high else math.inf
    left = b * b - a * c
    if left <= 0.0:
        return math.inf
    root = math.sqrt(left)
    low, high = max(low, (-b - root) / a), min(high, (-b + root) / a)
    return low if low <= high else math.inf


@compiled
def overlap_1d(distance: float, half: float, spacing: float) -> float:
    """Return the share of a cell, ``spacing`` [m] wide, that an interval of half length ``half`` at a ``distance`` [m]
    from the cell's middle covers."""
    left, right = max(distance - 0.5 * spacing, -half), min(distance + 0.5 * spacing, half)
    return max(right - left, 0.0) / spacing


@compiled
def covered_share(kind: int, half: Triple, rotation: Rotation, x: float, y: float, spacing: float) -> float:
    """Return the share of a sample's cell at (x, y) [m] that the shape covers.

    Exact for rectangles along the grid. In other directions single shares are approximate, but their sum over the
    samples is near the area. Round undersides cover whole cells: their pressure vanishes at the edge.
    """
    upright = vertical_axis(rotation)
    if kind == BOX:
        share = 1.0
        for axis in range(3):
            if axis != upright:
                share *= share_along(half[axis], rotation, axis, x, y, spacing)
        return share
    if kind == CYLINDER:
        if upright == 2:
            return min(max(0.5 + (half[0] - math.hypot(x, y)) / spacing, 0.0), 1.0)
        return share_along(half[2], rotation, 2, x, y, spacing)
    return 1.0


@compiled
def share_along(half: float, rotation: Rotation, axis: int, x: float, y: float, spacing: float) -> float:
    """Return the share of a cell that a shape covers along one of its axes, seen from above."""
    cos, sin = rotation[0][axis], rotation[1][axis]
    level = math.sqrt(cos * cos + sin * sin)
    return overlap_1d((cos * x + sin * y) / level, half * level, spacing)


@compiled
def patch_width(kind: int, half: Triple, rotation: Rotation) -> float:
    """Return the smaller dimension b of the contact patch [m], for Bekker's Kc / b: of a box its narrower side, of a
    lying cylinder its height, of round shapes the radius."""
    upright = vertical_axis(rotation)
    if kind == BOX:
        return 2.0 * min(half[(upright + 1) % 3], half[(upright + 2) % 3])
    if kind == CYLINDER:
        return 2.0 * half[0] if upright == 2 else 2.0 * half[2]
    return half[0]


@compiled
def slope_of(kind: int, rotation: Rotation) -> tuple[float, float]:
    """Return the slope of a shape's flat underside along columns and rows; of a lying cylinder or capsule, that of its
    axis; of a sphere zero."""
    if kind == SPHERE:
        return 0.0, 0.0
    upright = vertical_axis(rotation)
    if kind == BOX or upright == 2:
        return -rotation[0][upright] / rotation[2][upright], -rotation[1][upright] / rotation[2][upright]
    x, y, rise = rotation[0][2], rotation[1][2], rotation[2][2] / (1.0 - rotation[2][2] ** 2)
    return x * rise, y * rise


@compiled
def half_lengths(kind: int, half: Triple, rotation: Rotation, axis: int) -> float:
    """Return half the length of the shape along an axis of the grid [m]."""
    if kind == BOX:
        return half[0] * abs(rotation[axis][0]) + half[1] * abs(rotation[axis][1]) + half[2] * abs(rotation[axis][2])
    along = abs(rotation[axis][2])
    return half[2] * along + half[0] * (math.sqrt(max(1.0 - along * along, 0.0)) if kind == CYLINDER else 1.0)


@compiled
def reach(kind: int, half: Triple, rotation: Rotation, axis: int, spacing: float) -> float:
    """Return half the length, along an axis of the grid, of the rectangle around all places with an `underside` [m]."""
    upright, found = vertical_axis(rotation), half_lengths(kind, half, rotation, axis)
    if kind == BOX:
        for own in range(3):
            if own != upright:
                found += margin_along(rotation, own, spacing) * abs(rotation[axis][own])
    elif kind == CYLINDER:
        found += math.sqrt(2.0) * spacing if upright == 2 else spacing * 2.0 * abs(rotation[axis][2])
    return found


@compiled
def rotation_of(q: FloatArray, rotation: FloatArray) -> None:
    """Write the matrix (3, 3) of a unit quaternion (x, y, z, w) to ``rotation``."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
