"""Whole maps of any message or file: put into the terrain, and checked for what users must be warned of."""

from __future__ import annotations

from collections import deque
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.io.rasters import FloatGrid, Raster
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.patches.config import require_usable
from smartmesh_ros.terrain.grid import GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.noise_check import NO_FINDINGS, NoiseCheck
from smartmesh_ros.terrain.terrain import Terrain


def require_tile_fits(name: str, samples: int, terrain: Terrain, settings: Settings) -> None:
    """Raises `InputError` if the terrain with this tile would have too many tiles, or too many samples in all tiles."""
    others = [mesh for tile, mesh in terrain.tiles.items() if tile != name]
    if len(others) >= settings.most_tiles:
        raise InputError("size", f"{len(others) + 1} tiles are more than terrain.max_tiles = {settings.most_tiles}")
    total = samples + sum(mesh.size for mesh in others)
    if total > settings.max_samples:
        raise InputError("size", f"{total} samples in all are more than terrain.max_samples = {settings.max_samples}")


def take_map(
    terrain: Terrain, settings: Settings, tile: str, raster: Raster, velocities: FloatGrid | None, time: float
) -> None:
    """Puts a map of ``time`` [s] into the terrain.

    A map on the same grid replaces the heights of the last one. If the grid moved, samples that both grids share keep
    their velocities. The ground keeps its friction, unless the raster has another. On `InputError` the terrain is
    unchanged.
    """
    geometry, heights, variances, friction = raster
    known = terrain.tiles.get(tile)
    if isinstance(known, HeightMap) and known.geometry == geometry:
        known.replace(heights, time=time, velocities=velocities, variance=variances, friction=friction)
        return
    require_tile_fits(tile, geometry.size, terrain, settings)
    new = HeightMap(
        heights, geometry=geometry, time=time, velocities=velocities, variance=variances, friction=friction,
        motion=settings.motion,
    )  # fmt: skip
    require_usable(settings.world.patch, new, exact=False)
    terrain.put(tile, new)


# The log repeats a warning only after this long without one [s]; the diagnostics show it as long as it holds.
LOG_PAUSE = 600.0
ADVICE = "but are treated as moving ground: set terrain.changes: correction, or terrain.noise if the ground does move"


class MapChecks:
    """Finds maps of sensors and mappers that the node treats as moving ground, by a `NoiseCheck` for each tile.

    ``warning``: the suspected problem and which parameter to set; empty = none."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._checks: dict[str, NoiseCheck] = {}
        self._warned = -LOG_PAUSE  # steady time of the last warning [s]
        self.warning = ""

    def forget(self, tile: str | None = None) -> None:
        """Restarts the check of a tile, or of all tiles."""
        for name in [*self._checks] if tile is None else [tile]:
            self._checks.pop(name, None)
        self._update_warning()

    def take(self, tile: str, heightmap: HeightMap, time: float, *, given: bool) -> None:
        """Checks a whole map of a tile, of ``time`` [s]. Needs no check if changes are corrections, or if the map came
        with velocities (``given``), because its ground moves."""
        if given or heightmap.motion.corrects:
            if tile in self._checks:
                self.forget(tile)
            return
        check = self._checks.setdefault(tile, NoiseCheck())
        before = check.findings
        check.take(heightmap, time)
        if check.findings != before:
            self._update_warning()

    def _update_warning(self) -> None:
        """Updates ``warning``, and logs a new one."""
        seen = {tile: str(check.findings) for tile, check in self._checks.items() if check.findings != NO_FINDINGS}
        what = "; ".join(f"tile {tile!r}: {words}" if tile else words for tile, words in seen.items())
        now, before = monotonic(), self.warning
        self.warning = f"maps look like those of a sensor or mapper ({what}) {ADVICE}" if what else ""
        if self.warning and not before and now - self._warned >= LOG_PAUSE:
            self._logger.warning(self.warning)
        if self.warning or before:
            self._warned = now


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
