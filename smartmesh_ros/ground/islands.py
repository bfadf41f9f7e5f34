"""Islands: groups of bodies that may touch each other, and therefore sleep and wake together."""

import numpy as np

from smartmesh_ros.terrain.grid import BoolArray, IntArray


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
