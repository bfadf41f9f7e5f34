"""What may be wrong with maps: those of a sensor may count as moving ground, those of several publishers may disagree,
and a map may have no ground."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.io.rasters import Raster
from smartmesh_ros.node.endpoints import names_of
from smartmesh_ros.node.session import Session
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.noise_check import NO_FINDINGS, NoiseCheck

# The log repeats a warning only after this long without its problem [s]; the diagnostics show it as long as it holds.
LOG_PAUSE = 600.0
# Spacing of the samples that are searched for ground before all others [samples].
SPARSE = 16
# Heights (rows, columns) of a map or a part of it [m].
Heights = NDArray[np.floating[Any]]
ADVICE = "but are treated as moving ground: set terrain.changes: correction, or terrain.noise if the ground does move"
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


class MapChecks:
    """Checks the maps of each tile: by a `NoiseCheck`, by `Rivals`, and for ground. Sets the session's ``map_warning``
    to the first suspected problem."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._noise: dict[str, tuple[NoiseCheck, float]] = {}  # and the time of the last map [s]
        self._rivals: dict[str, Rivals] = {}
        self._empty: dict[str, int] = {}  # numbers of samples of tiles without any ground
        self._problems = {"rivals": "", "holes": "", "noise": ""}  # suspected, and what to do about them; "" = none
        self._warned = dict.fromkeys(self._problems, -LOG_PAUSE)  # steady times when they were last seen [s]

    def forget(self, tile: str | None = None) -> None:
        """Restarts the checks of a tile, or of all tiles."""
        for known in (self._noise, self._rivals, self._empty):
            for name in [*known] if tile is None else [tile]:
                known.pop(name, None)
        self._update()

    def note_holes(self, tile: str, heightmap: HeightMap, changed: Heights | None = None) -> None:
        """Notes whether a tile has any ground. ``changed``: the heights that are new (rows, columns), None = all."""
        if (changed is None or _is_hole(changed)) and _is_hole(heightmap.heights):
            self._empty[tile] = heightmap.size
        elif self._empty.pop(tile, None) is None:
            return
        self._update()

    def take(self, tile: str, raster: Raster, heightmap: HeightMap, time: float) -> None:
        """Checks a whole map of a tile, of ``time`` [s], that the ``heightmap`` has taken. Its noise needs no check if
        changes are corrections, or if the map came with velocities, because its ground moves."""
        if self._several():
            self._rivals.setdefault(tile, Rivals()).take(raster.geometry, raster.heights)
        else:
            self._rivals.clear()
        self.note_holes(tile, heightmap)
        check, last = self._noise.get(tile, (None, time))
        before = NO_FINDINGS if check is None else check.findings
        if raster.velocities is not None or heightmap.motion.corrects:
            self._noise.pop(tile, None)
            found = NO_FINDINGS
        else:
            if check is None or time < last:  # on another clock
                check = NoiseCheck()
            self._noise[tile] = check, time
            check.take(heightmap, time)
            found = check.findings
        if found != before or self._rivals or self._problems["rivals"]:
            self._update()

    def _several(self) -> bool:
        return any(topic.get_publisher_count() > 1 for topic in self._session.terrain_subscriptions)

    def _words_of(self, tile: str) -> str:
        """Return that the maps of a tile disagree, and of which nodes."""
        node, topics = self._session.node, [one.topic_name for one in self._session.terrain_subscriptions]
        names = names_of(one for topic in topics for one in node.get_publishers_info_by_topic(topic))
        come, cure = f"they come from {', '.join(names)}", "remap one of them, or give each a tile of its own"
        return f"maps of tile {tile!r} disagree; {come}: {cure}"

    def _update(self) -> None:
        """Update the suspected problems, and log new ones."""
        before, now = self._problems, self._session.clock.steady()
        rivals = next((tile for tile, rivals in self._rivals.items() if rivals.found), None)
        seen = {tile: str(check.findings) for tile, (check, _) in self._noise.items() if check.findings != NO_FINDINGS}
        noise = "; ".join(f"tile {tile!r}: {words}" if tile else words for tile, words in seen.items())
        empty, samples = next(reversed(self._empty.items()), ("", 0))
        place = f"tile {empty!r}" if empty else "the map"
        self._problems = {
            "rivals": "" if rivals is None else self._words_of(rivals),
            "holes": f"{place} has no ground: all its {samples} heights are NaN, which means a hole" if samples else "",
            "noise": f"maps look like those of a sensor or mapper ({noise}) {ADVICE}" if noise else "",
        }
        for kind, words in self._problems.items():
            if words and not before[kind] and now - self._warned[kind] >= LOG_PAUSE:
                self._session.node.get_logger().warning(words)
            if words or before[kind]:
                self._warned[kind] = now
        self._session.map_warning = next(filter(None, self._problems.values()), "")


def _is_hole(heights: Heights) -> bool:
    """Return True if all heights (rows, columns) are NaN."""
    return bool(np.isnan(heights[::SPARSE, ::SPARSE]).all() and np.isnan(heights).all())
