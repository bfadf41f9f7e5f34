"""What is remembered about each body when bodies come and go."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import IntArray

T = TypeVar("T", bound=NDArray[Any])


def carried_over(old: T, kept: IntArray, new: T) -> T:
    """The rows ``new`` (N, ...) that bodies start with, with what is known of those that stay; ``kept`` (N,): each
    body's row in ``old``, -1 = it is new."""
    known = kept >= 0
    new[known] = old[kept[known]]
    return new


def kept_rows(before: list[Any], now: list[Any]) -> IntArray:
    """Each item's place among those ``before`` (N,), -1 = it is new."""
    places = {id(item): index for index, item in enumerate(before)}
    return np.array([places.get(id(item), -1) for item in now], np.int64)
