"""Height maps for tests, and maps that come while a world steps."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros import HeightMap, Terrain, World
from smartmesh_ros.terrain.terrain import MainMesh


def level(side: int = 41, resolution: float = 0.1, **options: Any) -> HeightMap:
    """A square map at height zero around the origin, of so many samples a side."""
    half = 0.5 * (side - 1) * resolution
    heights = np.zeros((side, side), np.float32)
    return HeightMap(heights, resolution=resolution, origin=(-half, -half), **options)


def terrain_of(**tiles: MainMesh) -> Terrain:
    """A terrain of several maps or meshes."""
    terrain = Terrain()
    for name, mesh in tiles.items():
        terrain.put(name, mesh)
    return terrain


def moving(world: World, heights: Callable[[float], ArrayLike], steps: int, every: int = 4) -> Iterator[int]:
    """Step a world on one height map, and yield the number of each step that was made. Before every so many-th one a
    map comes of ``heights`` at its time [m], of one height or (rows, columns)."""
    ground = world.terrain.tiles[""]
    for step in range(steps):
        if step % every == 0:
            ground.replace(np.broadcast_to(heights(world.time), ground.heights.shape), time=world.time)
        world.step()
        yield step


def step_on_moving(world: World, heights: Callable[[float], ArrayLike], steps: int, every: int = 4) -> None:
    """Step a world as `moving` does."""
    for _ in moving(world, heights, steps, every):
        pass
