"""The terrain from its messages: height maps with region updates, and general meshes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.inputs import conversions
from smartmesh_ros.node.inputs.cdr_reader import CdrReader
from smartmesh_ros.terrain.grid import MOST_SAMPLES, GridGeometry
from smartmesh_ros.terrain.grid_track import cells_moved
from smartmesh_ros.terrain.scrolling import friction_moved, levelled

FloatGrid = NDArray[np.float32]
Friction = float | FloatGrid | None
# Messages that may wait. One more applies them all, so that memory stays bounded while no page is open.
MAX_WAITING = 2000


class Relief:
    """A height map of the terrain. New heights set ``changed``; ``geometry`` and ``first``, the heights of the first
    map, are constant. ``friction``: one coefficient of the ground, or (rows, columns), or None = 1."""

    def __init__(self, geometry: GridGeometry, heights: FloatGrid, friction: Friction = None) -> None:
        self.geometry = geometry
        self.friction = friction
        self.changed = True
        self.first = heights
        self._heights = heights
        self._own = False  # True = writable; False = a view of a message's bytes

    @property
    def heights(self) -> FloatGrid:
        """Heights (rows, columns) [m] above the map's origin; NaN = hole."""
        return self._heights

    def replace(self, heights: FloatGrid) -> None:
        """Replace all heights."""
        self._heights, self._own, self.changed = heights, False, True

    def write(self, row: int, column: int, heights: FloatGrid) -> None:
        """Replace the heights of a rectangle; samples beyond the map are ignored."""
        if not self._own:
            self._heights, self._own = self._heights.copy(), True
        rows, columns = heights.shape
        place = self._heights[row : row + rows, column : column + columns]
        place[:] = heights[: place.shape[0], : place.shape[1]]
        self.changed = True

    def at(self, xy_w: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return bilinearly interpolated heights (n,) [m] in the terrain's frame at points (n, 2) [m]; NaN off the
        map."""
        geometry = self.geometry
        grid = geometry.to_grid(xy_w)
        inside: NDArray[np.bool_] = np.all((grid >= 0.0) & (grid <= geometry.last), axis=1, keepdims=True)
        grid = np.where(inside, grid, 0.0)
        first = np.minimum(np.floor(grid), geometry.last - 1).astype(np.int64)
        (r, c), (v, u) = first.T, (grid - first).T
        h = self._heights
        upper, lower = h[r + 1, c] * (1 - u) + h[r + 1, c + 1] * u, h[r, c] * (1 - u) + h[r, c + 1] * u
        return np.where(inside[:, 0], lower * (1 - v) + upper * v + geometry.origin[2], np.nan)


class Mesh(NamedTuple):
    """A general mesh: vertices (V, 3) [m] and triangles (T, 3)."""

    vertices: NDArray[np.float64]
    triangles: NDArray[np.uint32]


class Ground:
    """All tiles, by name. Messages wait as bytes until `apply_waiting`, because a newer map often replaces them
    first."""

    def __init__(self) -> None:
        self.tiles: dict[str, Relief | Mesh] = {}
        self._waiting: list[tuple[Callable[[bytes], None], str | None, bytes]] = []

    def take_map(self, data: bytes) -> None:
        """Queue a Heightmap message and drop older messages of its tile."""
        tile = _tile_of(data)
        self._waiting = [entry for entry in self._waiting if entry[1] != tile]
        self._waiting.append((self._put_map, tile, data))

    def take_region(self, data: bytes) -> None:
        """Queue a HeightmapUpdate message."""
        self._wait(self._write_region, data)

    def take_mesh(self, data: bytes) -> None:
        """Queue a TerrainMesh message."""
        self._wait(self._put_mesh, data)

    def take_mesh_update(self, data: bytes) -> None:
        """Queue a TerrainMeshUpdate message."""
        self._wait(self._move_mesh, data)

    def put(self, tile: str, geometry: GridGeometry, heights: FloatGrid, friction: Friction = None) -> None:
        """Set the whole map of a tile. Without ``friction`` its ground keeps that of before."""
        known = self.tiles.get(tile)
        if friction is None and isinstance(known, Relief):
            friction = friction_moved(known.friction, cells_moved(known.geometry, levelled(known.geometry, geometry)))
        if isinstance(known, Relief) and known.geometry == geometry:
            known.replace(heights)
            known.friction = friction
        else:
            self.tiles[tile] = Relief(geometry, heights, friction)

    def apply_waiting(self) -> None:
        """Apply all waiting messages. Malformed ones are skipped, because the node reports them."""
        waiting, self._waiting = self._waiting, []
        for take, _, data in waiting:
            try:
                take(data)
            except InputError:
                continue

    def heights(self, xy_w: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the height (n,) [m] of the highest map at points (n, 2) [m]; NaN where no map is."""
        found = np.full(len(xy_w), np.nan)
        for tile in self.tiles.values():
            if isinstance(tile, Relief):
                found = np.fmax(found, tile.at(xy_w))
        return found

    def _wait(self, take: Callable[[bytes], None], data: bytes) -> None:
        self._waiting.append((take, _tile_of(data), data))
        if len(self._waiting) > MAX_WAITING:
            self.apply_waiting()

    def _put_map(self, data: bytes) -> None:
        new = conversions.map_from(data, MOST_SAMPLES)
        if new.geometry is None:
            self.tiles.pop(new.start.tile, None)
        else:
            self.put(new.start.tile, new.geometry, new.heights, new.friction)

    def _write_region(self, data: bytes) -> None:
        new = conversions.region_from(data, MOST_SAMPLES)
        tile = self.tiles.get(new.start.tile)
        if isinstance(tile, Relief):
            tile.write(new.row, new.column, new.heights)

    def _put_mesh(self, data: bytes) -> None:
        new = conversions.mesh_from(data, MOST_SAMPLES)
        if len(new.vertices):
            self.tiles[new.start.tile] = Mesh(new.vertices, new.triangles)
        else:
            self.tiles.pop(new.start.tile, None)

    def _move_mesh(self, data: bytes) -> None:
        new = conversions.mesh_update_from(data, MOST_SAMPLES)
        tile = self.tiles.get(new.start.tile)
        if isinstance(tile, Mesh):
            vertices = tile.vertices.copy()
            vertices[slice(None) if new.indices is None else new.indices] = new.vertices
            self.tiles[new.start.tile] = Mesh(vertices, tile.triangles)


def _tile_of(data: bytes) -> str | None:
    """Return the tile of a terrain message; None if the bytes are malformed."""
    try:
        return CdrReader(data).stamped().tile
    except InputError:
        return None
