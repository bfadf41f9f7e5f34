"""An independent copy of the terrain, kept from the messages that the node took, and what must hold against it."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Tile(NamedTuple):
    """A height map: samples (rows, columns) [m], place of the first one, distance of samples, and turn."""

    heights: NDArray[np.float64]
    origin: tuple[float, float, float]
    resolution: float
    yaw: float


class Oracle:
    """Tiles as the messages say they are."""

    def __init__(self) -> None:
        self.tiles: dict[str, Tile] = {}
        self.compared = 0  # vertices
        self.unresolved = 0  # vertices of maps whose samples lie closer together than their coordinates can tell

    def take_map(self, message: Any) -> None:
        """A Heightmap that the node took."""
        info, p = message.info, message.info.origin.position
        if info.width == 0 and info.height == 0:
            del self.tiles[message.tile]
            return
        grid = np.array(message.heights, np.float64)
        assert grid.size == info.width * info.height, "a map of the wrong length was taken"
        assert not np.isinf(grid).any(), "a map with infinite heights was taken"
        friction = np.array(message.friction, np.float64)
        assert friction.size in (0, 1, grid.size), "a map with friction of the wrong length was taken"
        assert not ((friction < 0.0) | np.isinf(friction)).any(), "a map with impossible friction was taken"
        for layer in message.layers:
            assert len(layer.values) in (0, 1, grid.size), "a map with a layer of the wrong length was taken"
            assert not (np.array(layer.values) < 0.0).any(), "a map with an impossible layer was taken"
        assert len(message.soil) in (0, grid.size), "a map with soils of the wrong length was taken"
        assert 255 not in message.soil, "a map with impossible soils was taken"
        assert math.isfinite(info.resolution), "a map of infinite resolution was taken"
        assert info.resolution > 0.0, "a map of no resolution was taken"
        q = info.origin.orientation
        assert abs(math.hypot(q.x, q.y, q.z, q.w) - 1.0) < 0.01, "a map whose orientation is no rotation was taken"
        assert np.isfinite([p.x, p.y, p.z]).all(), "a map at no finite place was taken"
        self.tiles[message.tile] = Tile(
            grid.reshape(info.height, info.width), (p.x, p.y, p.z), float(info.resolution), 2.0 * math.atan2(q.z, q.w)
        )

    def take_region(self, message: Any) -> None:
        """A HeightmapUpdate that the node took."""
        tile = self.tiles[message.tile]
        grid = np.array(message.heights, np.float64).reshape(message.height, message.width)
        assert not np.isinf(grid).any(), "a region with infinite heights was taken"
        tile.heights[message.y : message.y + message.height, message.x : message.x + message.width] = grid

    def require_same(self, terrain: Any) -> None:
        """Asserts that the node's terrain is what the messages say it is."""
        for name, mesh in terrain.tiles.items():
            heights = getattr(mesh, "heights", None)
            if heights is not None:
                assert name in self.tiles, f"tile {name!r} came out of nowhere"
                np.testing.assert_array_equal(heights, self.tiles[name].heights.astype(np.float32))
        assert self.tiles.keys() <= terrain.tiles.keys(), "a tile was lost"

    def require_on_map(self, name: str, vertices: Any) -> None:
        """Asserts that every vertex (n, 3) of a patch of a tile that lies on it is a sample of it, at its height."""
        if name not in self.tiles:
            return  # of a general mesh
        tile = self.tiles[name]
        x, y = (vertices[:, :2] - tile.origin[:2]).T
        cos, sin = math.cos(tile.yaw), math.sin(tile.yaw)
        grid = np.stack([-sin * x + cos * y, cos * x + sin * y], axis=1) / tile.resolution
        blur = np.spacing(np.abs([*tile.origin[:2], vertices[:, :2].max(initial=0.0)]).max()) / tile.resolution
        if not blur < 1e-3:
            self.unresolved += len(vertices)
            return
        cells = np.rint(grid)
        assert np.abs(grid - cells).max(initial=0.0) < 1e-3 + 4.0 * blur, "a vertex is not at a sample's place"
        rows, columns = tile.heights.shape
        inside = (cells >= 0).all(axis=1) & (cells < (rows, columns)).all(axis=1)
        row, column = cells[inside].astype(int).T
        expected = tile.heights[row, column] + tile.origin[2]
        off = np.abs(expected).max(initial=0.0, where=np.isfinite(expected)) * 1e-6
        np.testing.assert_allclose(vertices[inside, 2], expected, rtol=0.0, atol=1e-6 + off, equal_nan=True)
        self.compared += int(inside.sum())
