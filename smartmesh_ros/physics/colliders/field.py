"""PyBullet heightfields that are replaced in place."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pybullet as pb

from smartmesh_ros.compiled import compiled
from smartmesh_ros.physics.colliders.table import COLLIDERS, MISFIT, NOTHING, POSE, SAMPLES, VELOCITY, advance, push
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.moving_grid import read_window, to_world


def field_key(support: Any, radius: float, resolution: float, *, round_: bool) -> tuple[float, ...]:
    """Return rows, columns and spacing [m] of the field of a support; PyBullet cannot change these."""
    return int(support["rows"]), int(support["columns"]), resolution * int(support["stride"])


def make_field(client: Any, key: tuple[float, ...]) -> int:
    """Create PyBullet's collision shape of a field.

    The shape is rotated by 90 degrees from its grid, because PyBullet splits cells along the other diagonal than the
    main mesh, and the rotation makes the two agree (row r, column c of the patch is PyBullet's row columns - 1 - c,
    column r). PyBullet's first index runs along its x axis, although the argument is called columns.
    """
    rows, columns, spacing = int(key[0]), int(key[1]), key[2]
    bound = field_bound(rows, columns, spacing)
    heights = [0.0] * (rows * columns)
    heights[0], heights[-1] = -bound, bound
    return int(
        client.createCollisionShape(
            pb.GEOM_HEIGHTFIELD,
            meshScale=[spacing, spacing, 1.0],
            heightfieldData=heights,
            numHeightfieldRows=rows,
            numHeightfieldColumns=columns,
        )
    )


def describe_field(record: Any, key: tuple[float, ...]) -> None:
    """Write the constants of a field to its record of ``COLLIDER``."""
    record["rows"], record["columns"], record["spacing"] = key


def replace_field(client: int, shape: int, rows: int, columns: int, heights: list[float], *, filtered: bool) -> None:
    """Replace the heights [m] of a field, in PyBullet's order, with or without a filter of its inner edges. The
    filter's flag is passed in every call, because PyBullet otherwise drops the edge data. ``client``: PyBullet's id of
    the client."""
    pb.createCollisionShape(
        pb.GEOM_HEIGHTFIELD,
        flags=pb.GEOM_CONCAVE_INTERNAL_EDGE if filtered else 0,
        heightfieldData=heights,
        numHeightfieldRows=rows,
        numHeightfieldColumns=columns,
        replaceHeightfieldIndex=shape,
        physicsClientId=client,
    )


def field_bound(rows: int, columns: int, spacing: float) -> float:
    """Half height of a field's bounds in PyBullet [m].

    PyBullet never updates the bounds of a replaced heightfield (bullet3 issues 4200 and 4236), and ignores bodies
    outside them. A field's base lies at the body's foot, so the body is inside the bounds even if other ground is much
    higher or lower. Bounds of 200 m with a slight tilt would overlap those of many neighbouring bodies.
    """
    return min(0.5 * COLLIDERS.slope * (max(rows, columns) - 1) * spacing, COLLIDERS.hole)


class FieldMemory(NamedTuple):
    """``heights`` (F,): of all fields in PyBullet's order, relative to their bases [m]. ``at_contact`` (F,): the same
    when contacts were last dropped. ``above``: scratch memory for the new heights of one field."""

    heights: FloatArray
    at_contact: FloatArray
    above: FloatArray


class Drift(NamedTuple):
    """Difference between a field and its ground: ``off`` [m]: largest distance at a sample; ``change`` [m]: largest
    change of a height above the base; ``sunk`` [m]: largest sinking of a sample since the contacts were last
    dropped."""

    off: float
    change: float
    sunk: float


@compiled
def field_heights(grid, support, samples, time, hole, above):
    """Write the heights of a support's samples above its foot [m] to ``above``, in PyBullet's order; holes are ``hole``
    [m] deep. ``samples``: heights of fields that are not read from ``grid``."""
    rows, columns = support.rows, support.columns
    heights, rises = np.empty((rows, columns)), np.empty((rows, columns))
    if support.first >= 0:
        for k in range(rows * columns):
            heights[k // columns, k % columns] = samples[support.first + k]
    else:
        read_window(grid, support.row, support.column, support.stride, time, 0.0, heights, rises)
    k = 0
    for i in range(columns):
        for r in range(rows):
            height = heights[r, columns - 1 - i]
            above[k] = -hole if math.isnan(height) else height - support.foot_z
            k += 1


@compiled
def field_drift(grid, collider, support, above, heights, at_contact) -> Drift:
    """Return the difference between a field and heights ``above`` a support's foot; ``heights``, ``at_contact``: as in
    `plan_field`."""
    rows, columns, spacing = support.rows, support.columns, grid.resolution * support.stride
    raised = collider.z - support.foot_z
    off = change = sunk = steepest = tallest = 0.0
    for k in range(rows * columns):
        old = heights[collider.first + k]
        u = (columns - 1 - k // rows - 0.5 * (columns - 1)) * spacing
        v = (k % rows - 0.5 * (rows - 1)) * spacing
        x, y = u * grid.cos - v * grid.sin, u * grid.sin + v * grid.cos
        leans = collider.tilt_x * y - collider.tilt_y * x
        off = max(off, abs(old + raised + leans - above[k]))
        change = max(change, abs(above[k] - old))
        sunk = max(sunk, at_contact[collider.first + k] - above[k])
        tallest = max(tallest, abs(above[k]))
        steepest = max(steepest, abs(above[k] - above[max(k - 1, 0)]))
    # Tilting about the base also moves a sample sideways, in proportion to its height.
    tilt = math.sqrt(collider.tilt_x * collider.tilt_x + collider.tilt_y * collider.tilt_y)
    return Drift(off + tilt * tallest * steepest / spacing, change, sunk)


@compiled
def plan_field(grid, collider, support, samples, time, limits, memory, pose, velocity):
    """Return the changes that put a field onto the ground of a support, as bits; ``pose`` and ``velocity`` as in
    `plan_plane`.

    ``memory``: of all fields. ``samples``: as in `field_heights`.
    """
    heights, at_contact, above = memory.heights, memory.at_contact, memory.above
    rows, columns, stride = support.rows, support.columns, support.stride
    spacing = grid.resolution * stride
    if collider.rows != rows or collider.columns != columns or abs(collider.spacing - spacing) > 1e-9 * spacing:
        return MISFIT
    advance(collider, time)
    x, y = to_world(grid, support.row + 0.5 * (rows - 1) * stride, support.column + 0.5 * (columns - 1) * stride)
    yaw = math.atan2(grid.sin, grid.cos)
    field_heights(grid, support, samples, time, limits.hole, above)
    drift = field_drift(grid, collider, support, above, heights, at_contact)
    astray = collider.yaw - yaw
    astray = abs(astray - math.tau * round(astray / math.tau))
    aside = max(abs(collider.x - x), abs(collider.y - y)) + astray * 0.5 * (max(rows, columns) - 1) * spacing
    there = collider.there == 1
    here = there and aside <= limits.elsewhere * spacing
    change = NOTHING
    if not (here and drift.off <= limits.off):
        change = POSE
        if not (there and drift.change <= limits.same_height):
            change |= SAMPLES
            drops = not there or drift.sunk > limits.sunk
            if drops and there:
                collider.turned = 1 - collider.turned  # moves the cached contacts away, so that PyBullet drops them
            for k in range(rows * columns):
                if drops:
                    at_contact[collider.first + k] = above[k]
                heights[collider.first + k] = above[k]
        collider.x, collider.y, collider.z, collider.yaw = x, y, support.foot_z, yaw
        collider.tilt_x = collider.tilt_y = 0.0
        collider.there = 1
        half = 0.5 * (yaw + (1.5 if collider.turned == 1 else 0.5) * math.pi)
        pose[0], pose[1], pose[2] = x, y, support.foot_z
        pose[3], pose[4], pose[5], pose[6] = 0.0, 0.0, math.sin(half), math.cos(half)
    if push(collider, support, limits, change != NOTHING, velocity):
        change |= VELOCITY
    return change
