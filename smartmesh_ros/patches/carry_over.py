"""Keep the data of each body when bodies are added or removed."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray

T = TypeVar("T", bound=NDArray[Any])


def carried_over(old: T, kept: IntArray, new: T) -> T:
    """Copy the rows of bodies that stay from ``old`` into ``new`` (N, ...), which holds initial values, and return it;
    ``kept`` (N,): each body's row in ``old``, -1 = new."""
    known = kept >= 0
    new[known] = old[kept[known]]
    return new


def kept_rows(before: list[Any], now: list[Any]) -> IntArray:
    """Return the previous index of each item of ``now`` in ``before`` (N,), -1 = new."""
    places = {id(item): index for index, item in enumerate(before)}
    return np.array([places.get(id(item), -1) for item in now], np.int64)
