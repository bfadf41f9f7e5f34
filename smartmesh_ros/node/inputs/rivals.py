"""Publishers whose maps of one tile disagree: found, named in the diagnostics, and logged once."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.node.session import Session
from smartmesh_ros.terrain.grid import GridGeometry

Heights = NDArray[np.float32]
# Largest median difference of the heights of two maps that agree [m].
MAX_DIFFERENCE = 0.02
# Most samples to compare along each side.
COMPARED_PER_SIDE = 32
# The last maps to count, and the number of returns among them that reveals several publishers.
COUNTED, MIN_RETURNS = 12, 4


class Rivals:
    """Detects publishers whose maps of one tile disagree, such as two mappers on one topic; used only while the topic
    has several publishers.

    Messages do not name their publisher. But the maps of two disagreeing publishers return again and again to the
    heights that one of them published before the other; the maps of a single publisher do not.
    """

    def __init__(self) -> None:
        # The last map of each of two presumed publishers, the newest one last.
        self._known: list[tuple[GridGeometry, Heights]] = []
        self._returns: deque[bool] = deque(maxlen=COUNTED)

    @property
    def found(self) -> bool:
        """True if several publishers disagree."""
        return sum(self._returns) >= MIN_RETURNS

    def take(self, geometry: GridGeometry, heights: Heights) -> None:
        """Records a new map."""
        agrees = [disagreement(geometry, heights, *known) <= MAX_DIFFERENCE for known in self._known]
        goes_on = agrees[-1:] == [True]
        self._returns.append(any(agrees) and not goes_on)
        self._known = [*(self._known[:-1] if goes_on else self._known[-1:]), (geometry, heights)]


def disagreement(geometry: GridGeometry, heights: Heights, other: GridGeometry, others: Heights) -> float:
    """Return the median difference of the heights (rows, columns) [m] that two maps share; 0 if they share none."""
    size = (geometry.rows, geometry.columns)
    r, c = np.ix_(*(np.unique(np.linspace(0, n - 1, COMPARED_PER_SIDE).astype(int)) for n in size))
    places = np.rint(other.to_grid(geometry.to_world(r, c)))
    inside = ((places >= 0.0) & (places <= other.last)).all(axis=-1)
    there = places[inside].astype(int)
    gaps = heights[r, c][inside] + geometry.origin[2] - (others[there[:, 0], there[:, 1]] + other.origin[2])
    gaps = np.abs(gaps[np.isfinite(gaps)])
    return float(np.median(gaps)) if gaps.size else 0.0


class RivalMaps:
    """Looks for rivals of each tile. ``warning``: the tile and the publishers whose maps disagree; empty = none."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._tiles: dict[str, Rivals] = {}
        self._logged = False
        self.warning = ""

    def clear(self) -> None:
        """Forgets all maps."""
        self._tiles.clear()
        self.warning = ""

    def forget(self, tile: str) -> None:
        """Forgets the maps of a tile, which is gone."""
        if self._tiles.pop(tile, None) is not None and not self._found:
            self.warning = ""

    def _several(self) -> bool:
        return any(topic.get_publisher_count() > 1 for topic in self._session.terrain_subscriptions)

    @property
    def _found(self) -> bool:
        return any(of_tile.found for of_tile in self._tiles.values())

    def take(self, tile: str, geometry: GridGeometry, heights: Heights) -> None:
        """Records a new map of a tile, while a topic has a second publisher."""
        session = self._session
        if not self._several():
            self.clear()
            return
        self._tiles.setdefault(tile, Rivals()).take(geometry, heights)
        if not self._found:
            self.warning = ""
        elif not self.warning:
            topics = [topic.topic_name for topic in session.terrain_subscriptions]
            names = session.names.of_publishers(session.node, topics)
            if not names:
                return
            self.warning = (
                f"maps of tile {tile!r} disagree; they come from {', '.join(names)}: remap one of them, or give each a "
                "tile of its own"
            )
            if not self._logged:
                self._logged = True
                session.node.get_logger().warning(self.warning)
