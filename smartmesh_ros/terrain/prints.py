"""What bodies pressed into the heights of a map."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray

Heights = NDArray[np.float32]
# Rows and columns of no samples.
NO_PLACES = np.empty((0, 2), np.int64)


def corners(places: IntArray, others: IntArray) -> IntArray:
    """Return the first and the last row and column of all places (n, 2), as (2, 2)."""
    both = np.vstack((places, others))
    return np.stack((both.min(axis=0), both.max(axis=0)))


class Prints:
    """Prints: what bodies pressed into the heights (rows, columns) [m] of a map, over those that its sender knows.
    ``given`` (rows, columns) [m]: what its sender sent for pressed samples, NaN for others. ``corners`` (2, 2): of all
    prints so far."""

    def __init__(self, heights: Heights) -> None:
        self._heights = heights
        self.given = np.full_like(heights, np.nan)
        self.corners = NO_PLACES

    def press(self, places: IntArray, heights: Heights) -> None:
        """Write ``heights`` (n,) of the samples at ``places`` (n, 2), rows and columns."""
        at = tuple(places.T)
        given = self.given[at]
        self.given[at] = np.where(np.isnan(given), self._heights[at], given)
        self._heights[at] = heights
        self.corners = corners(places, self.corners)

    @contextmanager
    def lifted(self) -> Iterator[None]:
        """Take the prints out of the map for an update. Afterwards they are where its sender sent the same heights
        again, and are forgotten elsewhere."""
        box = tuple(slice(first, last + 1) for first, last in self.corners.T.tolist())
        heights, given = self._heights[box], self.given[box]
        pressed = ~np.isnan(given)
        prints, before = heights[pressed], given[pressed]
        heights[pressed] = before
        yield
        same = heights[pressed] == before
        heights[pressed] = np.where(same, prints, heights[pressed])
        given[pressed] = np.where(same, before, np.nan)
