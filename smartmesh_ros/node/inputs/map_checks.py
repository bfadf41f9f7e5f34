"""Maps of sensors and mappers that are taken for ground that moves: what the diagnostics and the log say of them."""

from __future__ import annotations

from time import monotonic
from typing import Any

from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.noise_check import NO_FINDINGS, NoiseCheck

# The log speaks again only of what was not seen for so long [s]; the diagnostics speak as long as it is seen.
QUIET = 600.0


class MapChecks:
    """A `NoiseCheck` for each tile. ``doubt``: what is wrong with the maps, and what to set; empty where nothing is."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._checks: dict[str, NoiseCheck] = {}
        self._doubted = -QUIET  # when there was a doubt last, by the steady clock [s]
        self.doubt = ""

    def forget(self, tile: str | None = None) -> None:
        """Starts anew with a tile, or with all of them."""
        for name in [*self._checks] if tile is None else [tile]:
            self._checks.pop(name, None)
        self._tell()

    def take(self, tile: str, heightmap: HeightMap, time: float, *, given: bool) -> None:
        """Takes note of a whole map of a tile, of ``time`` [s]. Velocities ``given`` with a map say that its ground
        moves, and where changes are corrections nothing is to be said."""
        if given or heightmap.motion.corrects:
            if tile in self._checks:
                self.forget(tile)
            return
        check = self._checks.setdefault(tile, NoiseCheck())
        before = check.findings
        check.take(heightmap, time)
        if check.findings != before:
            self._tell()

    def _tell(self) -> None:
        """Brings ``doubt`` up to date, and logs one that is new."""
        seen = {tile: str(check.findings) for tile, check in self._checks.items() if check.findings != NO_FINDINGS}
        now, before, self.doubt = monotonic(), self.doubt, ""
        if before:
            self._doubted = now
        if not seen:
            return
        what = "; ".join(f"tile {tile!r}: {words}" if tile else words for tile, words in seen.items())
        self.doubt = (
            f"maps look like those of a sensor or mapper ({what}) but are taken for ground that moves: set "
            "terrain.changes: correction, or terrain.noise if the ground does move"
        )
        if not before and now - self._doubted >= QUIET:
            self._logger.warning(self.doubt)
        self._doubted = now
