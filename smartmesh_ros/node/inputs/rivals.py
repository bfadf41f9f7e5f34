"""Detection of several publishers whose maps of the same ground disagree, such as two mappers on one topic.

Messages do not name their publisher. But the maps of two disagreeing publishers return again and again to the heights
that one of them published before the other; the maps of a single publisher do not.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from smartmesh_ros.node.endpoint_names import EndpointNames
from smartmesh_ros.terrain.grid import FloatArray, GridGeometry

# Largest median difference of the heights of two maps that agree [m].
MAX_DIFFERENCE = 0.02
# Most samples to compare along each side.
COMPARED_PER_SIDE = 32
# The last maps to count, and the number of returns among them that reveals several publishers.
COUNTED, MIN_RETURNS = 12, 4


class KnownMap(NamedTuple):
    """A map: its geometry and heights (rows, columns) [m]."""

    geometry: GridGeometry
    heights: NDArray[np.float32]


class Rivals:
    """Detects disagreeing publishers from the maps of one tile; used only while the topic has several publishers."""

    def __init__(self) -> None:
        self._known: list[KnownMap] = []  # the last map of each of two presumed publishers
        self._last = 0  # index of the presumed publisher of the last map
        self._returns: deque[bool] = deque(maxlen=COUNTED)

    @property
    def found(self) -> bool:
        """True if several publishers disagree."""
        return sum(self._returns) >= MIN_RETURNS

    def take(self, geometry: GridGeometry, heights: NDArray[np.float32]) -> None:
        """Records a new map."""
        new = KnownMap(geometry, heights)
        gaps = [disagreement(new, last) for last in self._known]
        nearest = int(np.argmin(gaps)) if gaps else 0
        known = bool(gaps) and gaps[nearest] <= MAX_DIFFERENCE
        self._returns.append(known and nearest != self._last)
        if known:
            self._known[nearest] = new
            self._last = nearest
        elif len(self._known) < 2:
            self._known.append(new)
            self._last = len(self._known) - 1
        else:
            self._last = 1 - self._last
            self._known[self._last] = new


def disagreement(one: KnownMap, other: KnownMap) -> float:
    """Return the median difference of the heights that two maps share [m]; 0 if they share none."""
    geometry = one.geometry
    rows = np.unique(np.linspace(0, geometry.rows - 1, COMPARED_PER_SIDE).astype(int))
    columns = np.unique(np.linspace(0, geometry.columns - 1, COMPARED_PER_SIDE).astype(int))
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
    """Return the names of the nodes that publish to ``subscriptions``, sorted; empty until all names have arrived."""
    topics = [subscription.topic_name for subscription in subscriptions]
    return names.of_all(peer for topic in topics for peer in node.get_publishers_info_by_topic(topic)) or []
