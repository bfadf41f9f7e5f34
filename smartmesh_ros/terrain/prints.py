"""Prints: heights that bodies pressed into a map, over those that its sender knows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray

Heights = NDArray[np.float32]


class Prints:
    """The prints in the heights of a map (rows, columns) [m]. ``given``: what its sender sent for their samples, NaN
    elsewhere."""

    def __init__(self, heights: Heights) -> None:
        self._heights = heights
        self._given = np.full_like(heights, np.nan)
        self._first, self._end = np.array(heights.shape), np.zeros(2, np.int64)

    def press(self, places: IntArray, heights: Heights) -> None:
        """Write ``heights`` (n,) of the samples at ``places`` (n, 2), rows and columns."""
        at = tuple(places.T)
        given = self._given[at]
        self._given[at] = np.where(np.isnan(given), self._heights[at], given)
        self._heights[at] = heights
        self._first = np.minimum(self._first, places.min(axis=0))
        self._end = np.maximum(self._end, places.max(axis=0) + 1)

    @contextmanager
    def lifted(self) -> Iterator[None]:
        """Take the prints out of the map for an update. Afterwards they are where its sender sent the same heights
        again, and are forgotten elsewhere."""
        box = tuple(slice(first, end) for first, end in zip(self._first, self._end, strict=True))
        heights, given = self._heights[box], self._given[box]
        pressed = ~np.isnan(given)
        prints, before = heights[pressed], given[pressed]
        heights[pressed] = before
        yield
        same = heights[pressed] == before
        heights[pressed] = np.where(same, prints, heights[pressed])
        given[pressed] = np.where(same, before, np.nan)
