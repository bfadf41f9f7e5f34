"""The terrain on the page: one mesh a tile, at full resolution near the bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.tools.view.decimation import DecimationConfig, Surface, coarsest_level, decimate
from smartmesh_ros.tools.view.ground import Ground, Mesh, Relief
from smartmesh_ros.tools.view.looks import GROUND
from smartmesh_ros.tools.view.sunk import Depth, Grip, Tint


@dataclass(frozen=True)
class TerrainConfig:
    """``margin``: distance around each body with full resolution, in radii. ``least``: minimum of that distance
    [samples]. ``period`` [s]: minimum time between two decimations, each of which takes tens of milliseconds for a
    large map, and between two refreshes of the colours of ground."""

    margin: float = 2.0
    least: float = 8.0
    period: float = 0.5
    decimation: DecimationConfig = field(default_factory=DecimationConfig)


class TerrainScene:
    """Draws the tiles of a `Ground` in a viser scene."""

    def __init__(self, scene: Any, config: TerrainConfig = TerrainConfig()) -> None:
        self._scene, self._config = scene, config
        self._shown: dict[str, _Relief | _Mesh] = {}

    def show(
        self, ground: Ground, bodies: NDArray[np.float64], radii: NDArray[np.float64], *, sunk: bool = False
    ) -> None:
        """Refresh the tiles, with bodies at (B, 3) [m] of ``radii`` (B,) [m]; ``sunk``: colour the ground that lies
        below its first map."""
        for name in set(self._shown) - set(ground.tiles):
            self._shown.pop(name).remove()
        for name, tile in ground.tiles.items():
            shown = self._shown.get(name)
            if shown is None or not shown.shows(tile):
                if shown is not None:
                    shown.remove()
                path = f"/terrain/{name or 'map'}"
                shown = _Mesh(self._scene, path) if isinstance(tile, Mesh) else _Relief(self._scene, path, tile)
                self._shown[name] = shown
            if isinstance(shown, _Mesh):
                shown.show(tile)
            else:
                shown.show(bodies, radii, self._config)
                shown.colour(sunk, self._config.period)


class _Mesh:
    """A general mesh, drawn as a whole."""

    def __init__(self, scene: Any, path: str) -> None:
        self._scene, self._path = scene, path
        self._handle: Any = None
        self._known: Mesh | None = None

    def shows(self, tile: Relief | Mesh) -> bool:
        return isinstance(tile, Mesh)

    def remove(self) -> None:
        if self._handle is not None:
            self._handle.remove()

    def show(self, tile: Any) -> None:
        if self._known is None or tile.triangles is not self._known.triangles:
            self._handle = _add(self._scene, self._path, tile.vertices, tile.triangles)
        elif tile is not self._known:
            self._handle.vertices = tile.vertices.astype(np.float32)
        self._known = tile


class _Relief:
    """A height map, decimated."""

    def __init__(self, scene: Any, path: str, tile: Relief) -> None:
        self._scene, self._path, self._tile = scene, path, tile
        self._handle: Any = None
        self._surface: Surface | None = None
        self._centres = np.zeros((0, 2))
        self._holes = np.zeros(0, np.bool_)
        self._due = 0.0
        self._sunk, self._grip = Tint(scene, f"/sunk{path}", Depth), Tint(scene, f"/grip{path}", Grip)
        geometry = tile.geometry
        shape = (geometry.rows, geometry.columns)
        self._is_whole = coarsest_level(shape, DecimationConfig().far_cells) == 0

    def shows(self, tile: Relief | Mesh) -> bool:
        return tile is self._tile

    def remove(self) -> None:
        self._sunk.remove()
        self._grip.remove()
        if self._handle is not None:
            self._handle.remove()

    def show(self, bodies: NDArray[np.float64], radii: NDArray[np.float64], config: TerrainConfig) -> None:
        tile = self._tile
        if self._cut(bodies, radii, config):
            self._draw()
        elif tile.changed:
            self._update_heights()
        else:
            return
        tile.changed = False
        self._sunk.stale = self._grip.stale = True

    def colour(self, sunk: bool, period: float) -> None:
        """Show the colours of sunk ground, or remove them, and those of friction."""
        if self._surface is None:
            return
        rows, columns = self._surface.rows, self._surface.columns
        if not sunk:
            self._sunk.remove()
        elif self._sunk.is_due:
            depths = self._tile.first[rows, columns].astype(np.float64) - self._tile.heights[rows, columns]
            self._sunk.show(self._vertices, depths, self._surface.triangles, period)
        friction = self._tile.friction
        if friction is None:
            self._grip.remove()
        elif self._grip.is_due:
            found = (
                np.full(len(rows), friction)
                if isinstance(friction, float)
                else friction[rows, columns].astype(np.float64)
            )
            found = np.where(np.isnan(found) | (found == 1.0), -1.0, found)  # in no band
            found[self._holes] = np.nan
            self._grip.show(self._vertices, found, self._surface.triangles, period)

    def _cut(self, bodies: NDArray[np.float64], radii: NDArray[np.float64], config: TerrainConfig) -> bool:
        """Decimate the map again if bodies have moved far; return True if it was decimated."""
        if self._surface is not None and (self._is_whole or monotonic() < self._due):
            return False
        geometry = self._tile.geometry
        centres = geometry.to_grid(bodies[:, :2])
        near = np.maximum(config.margin * radii / geometry.resolution, config.least)
        if self._surface is not None and len(centres) == len(self._centres):
            moved = np.abs(centres - self._centres).max(axis=1, initial=0.0)
            if (moved < 0.25 * near).all():
                return False
        self._due, self._centres = monotonic() + config.period, centres
        shape = (geometry.rows, geometry.columns)
        self._surface = decimate(shape, centres, near, config.decimation)
        xy = geometry.to_world(self._surface.rows, self._surface.columns)
        self._vertices = np.column_stack([xy, np.zeros(len(xy))]).astype(np.float32)
        return True

    def _update_heights(self) -> None:
        """Set new heights of the present vertices."""
        if not np.array_equal(self._set_heights(), self._holes):
            self._draw()
        else:
            self._handle.vertices = self._vertices

    def _set_heights(self) -> NDArray[np.bool_]:
        """Set the heights of the vertices; return a mask of those in holes."""
        assert self._surface is not None
        heights = self._tile.heights[self._surface.rows, self._surface.columns] + self._tile.geometry.origin[2]
        holes = np.isnan(heights)
        self._vertices = self._vertices.copy()  # the last array may still be in transmission
        self._vertices[:, 2] = np.where(holes, 0.0, heights)
        return np.asarray(holes)

    def _draw(self) -> None:
        """Draw the mesh without the triangles of holes."""
        assert self._surface is not None
        self._holes = self._set_heights()
        triangles = self._surface.triangles
        if self._holes.any():
            triangles = triangles[~self._holes[triangles].any(axis=1)]
        self._handle = _add(self._scene, self._path, self._vertices, triangles)


def _add(scene: Any, path: str, vertices: NDArray[Any], triangles: NDArray[Any]) -> Any:
    return scene.add_mesh_simple(path, vertices, triangles, color=GROUND, side="front", cast_shadow=False)
