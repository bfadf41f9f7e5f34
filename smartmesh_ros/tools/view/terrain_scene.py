"""The terrain on the page: a mesh a tile, at full resolution near bodies, and the colours of depth and friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray, GridGeometry
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.tools.view.decimation import decimate
from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.looks import GROUND, Entry
from smartmesh_ros.tools.view.meshes import Mesh, Meshes

# Height at which the colours of ground are drawn above it [m], below patches.
LIFT = np.array([0.0, 0.0, 0.003], np.float32)


class Depth(Entry, Enum):
    """Entries of the legend of sunk ground."""

    SLIGHT = "1 to 5 mm", (250, 226, 150), 0.001
    SHALLOW = "5 to 15 mm", (247, 176, 80), 0.005
    DEEP = "15 to 40 mm", (226, 106, 44), 0.015
    DEEPEST = "more than 40 mm", (158, 38, 34), 0.04


class Grip(Entry, Enum):
    """Entries of the legend of the ground's friction; 1 has the colour of ground."""

    ICE = "friction below 0.3", (112, 176, 236), 0.0
    SLIPPERY = "0.3 to 0.7", (152, 196, 226), 0.3
    FIRM = "0.7 to 1", (182, 200, 206), 0.7
    ROUGH = "more than 1", (160, 112, 66), 1.0


Bands = type[Depth] | type[Grip]


@dataclass(frozen=True)
class TerrainConfig:
    """``margin``: distance around each body with full resolution, in radii. ``least``: minimum of that distance
    [samples]. ``period`` [s]: minimum time between two decimations, each of which takes tens of milliseconds for a
    large map, and between two refreshes of the colours of ground."""

    margin: float = 2.0
    least: float = 8.0
    period: float = 0.5


class TerrainScene:
    """Draws the tiles of a `Ground` in a viser scene."""

    def __init__(self, scene: Any, config: TerrainConfig = TerrainConfig()) -> None:
        self._meshes, self._config = Meshes(scene), config
        self._reliefs: dict[str, _Relief] = {}

    def show(self, ground: Ground, bodies: FloatArray, radii: FloatArray, *, sunk: bool = False) -> None:
        """Refresh the tiles, with bodies at (B, 3) [m] of ``radii`` (B,) [m]; ``sunk``: colour the ground that lies
        below its first map."""
        meshes = {}
        for name, tile in ground.tiles.items():
            path = f"/terrain/{name or 'map'}"
            if not isinstance(tile, HeightMap):
                meshes[path] = Mesh(tile.vertices, tile.triangles, GROUND)
                continue
            relief = self._reliefs.get(name)
            if relief is None or relief.geometry != tile.geometry:
                relief = self._reliefs[name] = _Relief(tile.geometry, self._config)
            meshes[path] = relief.mesh(tile, bodies, radii)
            if tile.has_friction:
                meshes |= {f"/grip{path}/{grip}": mesh for grip, mesh in relief.grip(tile.friction)}
            if sunk:
                meshes |= {f"/sunk{path}/{depth}": mesh for depth, mesh in relief.sunk(ground.first[name])}
        self._meshes.show(meshes)


class _Relief:
    """A height map as a decimated mesh. What was made is kept while neither the map nor the bodies have changed."""

    def __init__(self, geometry: GridGeometry, config: TerrainConfig) -> None:
        self.geometry, self._config = geometry, config
        self._centres, self._due = np.full((1, 2), np.inf), 0.0
        self._mesh = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int64), GROUND)
        self._made_from, self._cuts = -1, 0  # revision of the map, and how often it was decimated
        # By kind of colours: what they were made from, when they may be made again [s], and their names and meshes.
        self._coloured: dict[Bands, tuple[Any, float, list[tuple[str, Mesh]]]] = {}

    def mesh(self, tile: HeightMap, bodies: FloatArray, radii: FloatArray) -> Mesh:
        """Return the mesh for bodies at (B, 3) [m] of ``radii`` (B,) [m]."""
        if self._cut(bodies, radii) or self._made_from != tile.revision:
            self._made_from, self._heights = tile.revision, tile.heights[self._surface.rows, self._surface.columns]
            holes = np.isnan(self._heights)
            z = np.where(holes, 0.0, self._heights + self.geometry.origin[2])
            triangles = self._surface.triangles
            if holes.any():
                triangles = triangles[~holes[triangles].any(axis=1)]
            self._mesh = Mesh(np.column_stack([self._xy, z]).astype(np.float32), triangles, GROUND)
        return self._mesh

    def sunk(self, first: NDArray[np.float32]) -> list[tuple[str, Mesh]]:
        """Return the colours of the ground that lies below the heights of its ``first`` map (rows, columns) [m]."""
        return self._colours(Depth, lambda place: first[place].astype(np.float64) - self._heights)

    def grip(self, friction: float | NDArray[np.float32]) -> list[tuple[str, Mesh]]:
        """Return the colours of the ground whose ``friction``, one number or (rows, columns), is not 1."""

        def values(place: tuple[Any, Any]) -> FloatArray:
            shape = self.geometry.rows, self.geometry.columns
            found: FloatArray = np.broadcast_to(friction, shape)[place].astype(np.float64)
            found[np.isnan(found) | (found == 1.0)] = -1.0  # below all entries
            found[np.isnan(self._heights)] = np.nan
            return found

        return self._colours(Grip, values)

    def _colours(self, bands: Bands, values: Callable[[tuple[Any, Any]], FloatArray]) -> list[tuple[str, Mesh]]:
        """Return the colours by the ``values`` at places (rows, columns), by name."""
        made_from, due, meshes = self._coloured.get(bands, (None, 0.0, []))
        if made_from != (self._made_from, self._cuts) and monotonic() >= due:
            found = values((self._surface.rows, self._surface.columns))
            vertices, meshes = self._mesh.vertices + LIFT, []
            for band, chosen in triangles_by_band(found, self._surface.triangles, bands):
                used, places = np.unique(chosen, return_inverse=True)
                meshes.append((band.name, Mesh(vertices[used], places.reshape(-1, 3), band.colour)))
            self._coloured[bands] = (self._made_from, self._cuts), monotonic() + self._config.period, meshes
        return meshes

    def _cut(self, bodies: FloatArray, radii: FloatArray) -> bool:
        """Decimate the map again if bodies have moved far; return True if it was decimated."""
        geometry, config = self.geometry, self._config
        centres = geometry.to_grid(bodies[:, :2])
        near = np.maximum(config.margin * radii / geometry.resolution, config.least)
        same = len(centres) == len(self._centres) and (np.abs(centres - self._centres) < 0.25 * near[:, None]).all()
        if same or monotonic() < self._due:
            return False
        self._due, self._centres, self._cuts = monotonic() + config.period, centres, self._cuts + 1
        self._surface = decimate((geometry.rows, geometry.columns), centres, near)
        self._xy = geometry.to_world(self._surface.rows, self._surface.columns)
        return True


def triangles_by_band(values: FloatArray, triangles: NDArray[Any], bands: Bands) -> Iterator[tuple[Any, NDArray[Any]]]:
    """Yield each band that there is, and its triangles (n, 3), by the corner with the largest of the ``values`` (V,) of
    the vertices. Triangles with a NaN, or below the first band, are left out."""
    largest = np.nan_to_num(values[triangles].max(axis=1), nan=-np.inf)
    found = np.digitize(largest, [band.least for band in bands]) - 1
    for number, band in enumerate(bands):
        if (found == number).any():
            yield band, triangles[found == number]
