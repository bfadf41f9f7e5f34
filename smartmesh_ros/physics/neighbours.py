"""Which bodies may touch: bounding boxes, their overlaps, and the islands of bodies that these connect."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.patches.solids import extents, solid_of
from smartmesh_ros.terrain.grid import BoolArray, FloatArray, IntArray

# Columns of a table of boxes (S, 6): lowest and highest x, y, z [m].
BOX_COLUMNS = 6


@compiled
def write_boxes(chosen: IntArray, shapes: Any, states: FloatArray, boxes: FloatArray) -> None:
    """Write the bounding boxes (S, 6) of the bodies in the slots ``chosen`` (n,)."""
    for k in range(len(chosen)):
        i = chosen[k]
        solid = solid_of(shapes, i, states[i])
        half = extents(solid)
        boxes[i, 0], boxes[i, 3] = solid.centre.x - half.x, solid.centre.x + half.x
        boxes[i, 1], boxes[i, 4] = solid.centre.y - half.y, solid.centre.y + half.y
        boxes[i, 2], boxes[i, 5] = solid.centre.z - half.z, solid.centre.z + half.z


@compiled
def apart(a: FloatArray, b: FloatArray) -> float:
    """Return the largest distance of two boxes (6,) along an axis [m], negative if they overlap."""
    most = -math.inf
    for axis in range(3):
        most = max(most, a[axis] - b[axis + 3], b[axis] - a[axis + 3])
    return most


@compiled
def root_of(parents: IntArray, k: int) -> int:
    """Return the root of an item in a forest of parents (n,), and shorten the way to it."""
    while parents[k] != k:
        parents[k] = parents[parents[k]]
        k = parents[k]
    return k


@compiled
def islands(
    chosen: IntArray, owners: IntArray, boxes: FloatArray, radii: FloatArray, near: float, near_share: float
) -> IntArray:
    """Return the island of each body in the slots ``chosen`` (n,), by the place of one of its members in ``chosen``.

    Two bodies are in one island if they have the same of the ``owners`` (S,), or if their boxes (S, 6) are closer than
    ``near`` [m] plus ``near_share`` of both ``radii`` (S,) [m], or through others.
    """
    count = len(chosen)
    parents = np.arange(count)
    order = np.argsort(boxes[chosen, 0])
    by_owner = np.argsort(owners[chosen])
    for m in range(1, count):
        a, b = by_owner[m - 1], by_owner[m]
        if owners[chosen[a]] == owners[chosen[b]]:
            parents[root_of(parents, a)] = root_of(parents, b)
    largest = 0.0
    for k in range(count):
        largest = max(largest, radii[chosen[k]])
    for m in range(count):
        a = chosen[order[m]]
        for n in range(m + 1, count):
            b = chosen[order[n]]
            if boxes[b, 0] > boxes[a, 3] + near + near_share * (radii[a] + largest):
                break
            if apart(boxes[a], boxes[b]) <= near + near_share * (radii[a] + radii[b]):
                parents[root_of(parents, order[m])] = root_of(parents, order[n])
    for k in range(count):
        parents[k] = root_of(parents, k)
    return parents


@compiled
def mark_near(
    box: FloatArray, reach: float, radius: float, order: IntArray, widest: float, boxes: FloatArray, radii: FloatArray,
    near_share: float, found: BoolArray,
) -> bool:  # fmt: skip
    """Mark in ``found`` (S,) the bodies whose boxes are within ``reach`` [m], plus ``near_share`` of both radii, of a
    ``box`` (6,); returns True if there are any new ones.

    ``order`` (m,): slots of the bodies to search, in ascending order of their lowest x; ``widest`` [m]: largest extent
    of their boxes along x, plus ``near_share`` of their largest radius.
    """
    any_new = False
    reach += near_share * radius
    low, high = box[0] - reach - widest, box[3] + reach + widest
    first, last = 0, len(order)
    while first < last:  # binary search
        middle = (first + last) // 2
        if boxes[order[middle], 0] < low:
            first = middle + 1
        else:
            last = middle
    for m in range(first, len(order)):
        i = order[m]
        if boxes[i, 0] > high:
            break
        if not found[i] and apart(box, boxes[i]) <= reach + near_share * radii[i]:
            found[i] = any_new = True
    return any_new


@compiled
def mark_connected(
    order: IntArray, widest: float, boxes: FloatArray, radii: FloatArray, near: float, near_share: float,
    found: BoolArray,
) -> None:  # fmt: skip
    """Mark in ``found`` (S,) all bodies that are connected to marked ones; arguments as in `mark_near`."""
    searched = np.zeros(len(found), np.bool_)
    more = True
    while more:
        more = False
        for m in range(len(order)):
            i = order[m]
            if found[i] and not searched[i]:
                searched[i] = True
                if mark_near(boxes[i], near, radii[i], order, widest, boxes, radii, near_share, found):
                    more = True


def first_groups(groups: IntArray, most: int) -> BoolArray:
    """Return which items (n,) are in the first groups that have at most ``most`` items together; at least one group."""
    numbers, counts = np.unique(groups, return_counts=True)
    fits = np.cumsum(counts) <= most
    fits[0] = True
    return np.isin(groups, numbers[fits])


def all_of(marks: BoolArray, groups: IntArray) -> BoolArray:
    """Return for each item (n,) whether all items of its group are marked; ``groups`` (n,)."""
    unmarked = np.unique(groups[~marks])
    return ~np.isin(groups, unmarked)
