"""The terrain on the page: one mesh a tile, at full resolution near the bodies, and the colours of sunk ground."""

from __future__ import annotations

from collections.abc import Iterator
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

# Height at which the colours of sunk ground are drawn above it [m], below patches.
LIFT = np.array([0.0, 0.0, 0.003], np.float32)


class Depth(Entry, Enum):
    """Entries of the legend of sunk ground."""

    SLIGHT = "1 to 5 mm", (250, 226, 150), 0.001
    SHALLOW = "5 to 15 mm", (247, 176, 80), 0.005
    DEEP = "15 to 40 mm", (226, 106, 44), 0.015
    DEEPEST = "more than 40 mm", (158, 38, 34), 0.04


@dataclass(frozen=True)
class TerrainConfig:
    """``margin``: distance around each body with full resolution, in radii. ``least``: minimum of that distance
    [samples]. ``period`` [s]: minimum time between two decimations, each of which takes tens of milliseconds for a
    large map, and between two refreshes of the colours of sunk ground."""

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
            if sunk:
                meshes |= {f"/sunk{path}/{depth.name}": mesh for depth, mesh in relief.sunk(ground.first[name])}
        self._meshes.show(meshes)


class _Relief:
    """A height map as a decimated mesh. What was made is kept while neither the map nor the bodies have changed."""

    def __init__(self, geometry: GridGeometry, config: TerrainConfig) -> None:
        self.geometry, self._config = geometry, config
        self._centres, self._due, self._sunk_due = np.full((1, 2), np.inf), 0.0, 0.0
        self._mesh = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int64), GROUND)
        self._made_from = self._coloured = -1  # revisions of the map
        self._sunk: list[tuple[Depth, Mesh]] = []

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

    def sunk(self, first: NDArray[np.float32]) -> list[tuple[Depth, Mesh]]:
        """Return the colours of the ground that lies below the heights of its ``first`` map (rows, columns) [m]."""
        if self._coloured != self._made_from and monotonic() >= self._sunk_due:
            self._coloured, self._sunk_due = self._made_from, monotonic() + self._config.period
            depths = first[self._surface.rows, self._surface.columns].astype(np.float64) - self._heights
            vertices, triangles = self._mesh.vertices + LIFT, self._surface.triangles
            self._sunk = []
            for depth, chosen in triangles_by_depth(depths, triangles):
                used, places = np.unique(chosen, return_inverse=True)
                self._sunk.append((depth, Mesh(vertices[used], places.reshape(-1, 3), depth.colour)))
        return self._sunk

    def _cut(self, bodies: FloatArray, radii: FloatArray) -> bool:
        """Decimate the map again if bodies have moved far; return True if it was decimated."""
        geometry, config = self.geometry, self._config
        centres = geometry.to_grid(bodies[:, :2])
        near = np.maximum(config.margin * radii / geometry.resolution, config.least)
        same = len(centres) == len(self._centres) and (np.abs(centres - self._centres) < 0.25 * near[:, None]).all()
        if same or monotonic() < self._due:
            return False
        self._due, self._centres, self._coloured = monotonic() + config.period, centres, -1
        self._surface = decimate((geometry.rows, geometry.columns), centres, near)
        self._xy = geometry.to_world(self._surface.rows, self._surface.columns)
        return True


def triangles_by_depth(sunk: FloatArray, triangles: NDArray[Any]) -> Iterator[tuple[Depth, NDArray[Any]]]:
    """Yield the triangles (n, 3) of each depth that there is, by the deepest corner; ``sunk`` (V,) [m] is the depth of
    each vertex, NaN = hole. Triangles with a corner in a hole are left out."""
    deepest = np.nan_to_num(sunk[triangles].max(axis=1))
    bands = np.digitize(deepest, [depth.least for depth in Depth]) - 1
    for band, depth in enumerate(Depth):
        if (bands == band).any():
            yield depth, triangles[bands == band]
