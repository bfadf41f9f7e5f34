"""What may be wrong with maps that are taken."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.noise_check import NO_FINDINGS, NoiseCheck

# The log repeats a warning only after this long without one [s]; the diagnostics show it as long as it holds.
LOG_PAUSE = 600.0
# Spacing of the samples that are searched for ground before all others [samples].
SPARSE = 16
# Heights (rows, columns) of a map or a part of it [m].
Heights = NDArray[np.floating[Any]]
ADVICE = "but are treated as moving ground: set terrain.changes: correction, or terrain.noise if the ground does move"


class MapChecks:
    """Finds maps of sensors and mappers that the node treats as moving ground, by a `NoiseCheck` for each tile.

    ``warning``: the suspected problem and which parameter to set, or that there is no ground; empty = none."""

    def __init__(self, logger: Any, now: Callable[[], float] = monotonic) -> None:
        self._logger, self._now = logger, now
        self._checks: dict[str, NoiseCheck] = {}
        self._times: dict[str, float] = {}  # of the last map of each tile [s]
        self._empty: dict[str, int] = {}  # numbers of samples of tiles without any ground
        self._warned = -LOG_PAUSE  # steady time of the last warning [s]
        self.warning = ""

    def forget(self, tile: str | None = None) -> None:
        """Restarts the check of a tile, or of all tiles."""
        for name in {*self._checks, *self._empty, *self._times} if tile is None else [tile]:
            self._checks.pop(name, None)
            self._empty.pop(name, None)
            self._times.pop(name, None)
        self._update_warning()

    def note_holes(self, tile: str, heightmap: HeightMap, changed: Heights | None = None) -> None:
        """Notes whether a tile has any ground. ``changed``: the heights that are new (rows, columns), None = all."""
        if (changed is None or _is_hole(changed)) and _is_hole(heightmap.heights):
            self._empty[tile] = heightmap.size
        elif self._empty.pop(tile, None) is None:
            return
        self._update_warning()

    def take(self, tile: str, heightmap: HeightMap, time: float, *, given: bool) -> None:
        """Checks a whole map of a tile, of ``time`` [s]. Needs no check if changes are corrections, or if the map came
        with velocities (``given``), because its ground moves."""
        if given or heightmap.motion.corrects:
            if tile in self._checks:
                self.forget(tile)
            return
        if time < self._times.get(tile, time):  # on another clock
            self.forget(tile)
        self._times[tile] = time
        check = self._checks.setdefault(tile, NoiseCheck())
        before = check.findings
        check.take(heightmap, time)
        if check.findings != before:
            self._update_warning()

    def _update_warning(self) -> None:
        """Updates ``warning``, and logs a new one."""
        seen = {tile: str(check.findings) for tile, check in self._checks.items() if check.findings != NO_FINDINGS}
        what = "; ".join(f"tile {tile!r}: {words}" if tile else words for tile, words in seen.items())
        now, before = self._now(), self.warning
        self.warning = f"maps look like those of a sensor or mapper ({what}) {ADVICE}" if what else ""
        for tile, samples in self._empty.items():
            place = f"tile {tile!r}" if tile else "the map"
            self.warning = f"{place} has no ground: all its {samples} heights are NaN, which means a hole"
        if self.warning and not before and now - self._warned >= LOG_PAUSE:
            self._logger.warning(self.warning)
        if self.warning or before:
            self._warned = now


def _is_hole(heights: Heights) -> bool:
    """Return True if all heights (rows, columns) are NaN."""
    return bool(np.isnan(heights[::SPARSE, ::SPARSE]).all() and np.isnan(heights).all())
