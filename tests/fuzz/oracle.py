"""What must hold of a terrain that takes messages, and of the patches on it."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros import HeightMap, Terrain


def maps_of(terrain: Terrain) -> dict[str, NDArray[np.float32]]:
    """Copies of the heights of all height maps, by tile."""
    return {name: mesh.heights.copy() for name, mesh in terrain.tiles.items() if isinstance(mesh, HeightMap)}


def updates_of(terrain: Terrain) -> list[Any]:
    """Names, numbers of updates, and heights or vertices of all maps and meshes, also of decks. What is refused changes
    none of them; it may shift the times of a map by rounding."""
    found: list[Any] = []
    for place, tiles in (("", terrain), *terrain.decks.items()):
        for name, mesh in tiles.tiles.items():
            shape = mesh.heights if isinstance(mesh, HeightMap) else mesh.vertices
            found += [place, name, id(mesh), mesh.version, np.array(shape).tobytes()]
    return found


def require_taken(message: Any, terrain: Terrain, before: dict[str, NDArray[np.float32]]) -> None:
    """Asserts that a Heightmap or a HeightmapUpdate was possible, and changed the maps of ``before`` as it says."""
    whole = hasattr(message, "info")
    size = (message.info.height, message.info.width) if whole else (message.height, message.width)
    expected = {**before}
    if whole and size == (0, 0):
        expected.pop(message.tile, None)
    else:
        require_possible(message, size)
        new = np.array(message.heights, np.float32).reshape(size)
        expected[message.tile] = new if whole else before[message.tile].copy()
        if not whole:
            rows, columns = slice(message.y, message.y + size[0]), slice(message.x, message.x + size[1])
            expected[message.tile][rows, columns] = new
    found = maps_of(terrain)
    assert found.keys() == expected.keys(), "a tile was lost, or came out of nowhere"
    for name, heights in found.items():
        np.testing.assert_array_equal(heights, expected[name])


def require_possible(message: Any, size: tuple[int, int]) -> None:
    """Asserts that no number of a message that was taken is impossible."""
    samples = size[0] * size[1]
    assert not np.isinf(message.heights).any(), "infinite heights were taken"
    for layer in message.layers:
        assert len(layer.values) in (0, 1, samples), "a layer of the wrong length was taken"
        assert not (np.array(layer.values) < 0.0).any(), "an impossible layer was taken"
    if not hasattr(message, "info"):
        return
    friction = np.array(message.friction)
    assert friction.size in (0, 1, samples), "friction of the wrong length was taken"
    assert not ((friction < 0.0) | np.isinf(friction)).any(), "impossible friction was taken"
    assert len(message.soil) in (0, samples) and 255 not in message.soil, "impossible soils were taken"
    p, q = message.info.origin.position, message.info.origin.orientation
    assert 0.0 < message.info.resolution < math.inf, "an impossible resolution was taken"
    assert abs(math.hypot(q.x, q.y, q.z, q.w) - 1.0) < 0.01, "an orientation that is no rotation was taken"
    assert np.isfinite([p.x, p.y, p.z]).all(), "a map at no finite place was taken"


def on_map(mesh: Any, vertices: NDArray[np.float64]) -> dict[str, int]:
    """Asserts that every vertex (n, 3) of a patch of a tile that lies on it is a sample of it, at its height. Returns
    how many were compared, and how many lie closer together than their coordinates can tell."""
    if not isinstance(mesh, HeightMap):
        return {}
    geometry, heights = mesh.geometry, mesh.heights
    farthest = np.abs([*geometry.origin[:2], vertices[:, :2].max(initial=0.0)]).max()
    blur = np.spacing(farthest) / geometry.resolution
    if not blur < 1e-3:
        return {"unresolved": len(vertices)}
    grid = geometry.to_grid(vertices[:, :2])
    cells = np.rint(grid)
    assert np.abs(grid - cells).max(initial=0.0) < 1e-3 + 4.0 * blur, "a vertex is not at a sample's place"
    inside = (cells >= 0).all(axis=1) & (cells < heights.shape).all(axis=1)
    row, column = cells[inside].astype(int).T
    expected = heights[row, column].astype(np.float64) + geometry.origin[2]
    off = np.abs(expected).max(initial=0.0, where=np.isfinite(expected)) * 1e-6
    np.testing.assert_allclose(vertices[inside, 2], expected, rtol=0.0, atol=1e-6 + off, equal_nan=True)
    return {"vertices": int(inside.sum())}
