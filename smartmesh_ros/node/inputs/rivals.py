"""Several publishers of the same ground whose maps disagree: two mappers on one topic.

Messages do not say who sent them. But maps of two publishers that disagree come back, again and again, to what one of
them said before the other spoke; those of one publisher do not.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from smartmesh_ros.node.endpoint_names import EndpointNames
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry

# Maps whose heights differ by more than this disagree, in the median [m].
DISAGREE = 0.02
# Samples on a side that are compared, at most.
COMPARED = 32
# Maps that are remembered to have come back to another's, and how many of them make rivals.
REMEMBERED, MANY = 12, 4


class Seen(NamedTuple):
    """A map: its geometry and heights (rows, columns) [m]."""

    geometry: GridGeometry
    heights: NDArray[np.float32]


class Rivals:
    """What the maps of one tile say about their publishers; asked only while there are several."""

    def __init__(self) -> None:
        self._kinds: list[Seen] = []  # the last map of each of two publishers
        self._last = 0  # which of them spoke last
        self._returns: deque[bool] = deque(maxlen=REMEMBERED)

    @property
    def found(self) -> bool:
        """Whether there are rivals."""
        return sum(self._returns) >= MANY

    def take(self, geometry: GridGeometry, heights: NDArray[np.float32]) -> None:
        """Takes note of a map."""
        new = Seen(geometry, heights)
        gaps = [disagreement(new, kind) for kind in self._kinds]
        nearest = int(np.argmin(gaps)) if gaps else 0
        known = bool(gaps) and gaps[nearest] <= DISAGREE
        self._returns.append(known and nearest != self._last)
        if known:
            self._kinds[nearest] = new
            self._last = nearest
        elif len(self._kinds) < 2:
            self._kinds.append(new)
            self._last = len(self._kinds) - 1
        else:
            self._last = 1 - self._last
            self._kinds[self._last] = new


def disagreement(one: Seen, other: Seen) -> float:
    """By how much two maps differ where both have ground, in the median [m]; 0 where they share none."""
    geometry = one.geometry
    rows = np.unique(np.linspace(0, geometry.rows - 1, COMPARED).astype(int))
    columns = np.unique(np.linspace(0, geometry.columns - 1, COMPARED).astype(int))
    r, c = np.meshgrid(rows, columns, indexing="ij")
    places: FloatArray = np.rint(other.geometry.to_grid(geometry.to_world(r, c)))
    inside = ((places >= 0.0) & (places <= other.geometry.last)).all(axis=-1)
    there = places[inside].astype(int)
    gaps = np.abs(
        (one.heights[r, c][inside] + geometry.origin[2])
        - (other.heights[there[:, 0], there[:, 1]] + other.geometry.origin[2])
    )
    gaps = gaps[np.isfinite(gaps)]
    return float(np.median(gaps)) if gaps.size else 0.0


def publisher_names(node: Node, subscriptions: list[Any], names: EndpointNames) -> list[str]:
    """The nodes that publish on the topics of ``subscriptions``, sorted; empty until the names of all have arrived."""
    topics = [subscription.topic_name for subscription in subscriptions]
    return names.of_all(peer for topic in topics for peer in node.get_publishers_info_by_topic(topic)) or []
