"""Everything the bodies stand on: one height map, or several tiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.heightmap import HeightMap, Samples


class Terrain:
    """Height maps by name; the single map of a terrain without tiles is called ``""``."""

    def __init__(self, single: HeightMap | None = None) -> None:
        self.tiles: dict[str, HeightMap] = {}
        if single is not None:
            self.put("", single)

    @classmethod
    def of(cls, ground: HeightMap | Terrain) -> Terrain:
        """``ground`` itself, or the terrain of that single map."""
        return ground if isinstance(ground, Terrain) else cls(ground)

    def put(self, name: str, heightmap: HeightMap) -> None:
        """Adds a tile or takes the place of the one of that name."""
        self.tiles[name] = heightmap

    def remove(self, name: str) -> None:
        """Takes a tile away; raises `InputError` if there is none of that name."""
        self.tile(name)
        del self.tiles[name]

    def tile(self, name: str) -> HeightMap:
        """The tile of that name; raises `InputError` if there is none."""
        try:
            return self.tiles[name]
        except KeyError:
            known = ", ".join(repr(tile) for tile in self.tiles) or "none yet"
            raise InputError("unknown_tile", f"there is no tile {name!r}; known: {known}") from None

    def shift_time(self, by: float) -> None:
        """Moves the times of all maps by so many seconds, when the clock they are stamped with is set anew."""
        for heightmap in self.tiles.values():
            heightmap.shift_time(by)

    def at(self, xy_w: ArrayLike, time: float) -> Samples:
        """Ground under N points (N, 2) [m] at ``time`` [s]; NaN where no tile has ground. Shapes (N,)."""
        points = np.atleast_2d(np.asarray(xy_w, np.float64))
        heights = np.full(len(points), np.nan)
        velocities = np.zeros(len(points))
        for heightmap in self.tiles.values():
            missing = np.isnan(heights)
            if not missing.any():
                break
            found = heightmap.at(points[missing], time)
            heights[missing] = found.heights
            velocities[missing] = 0.0 if found.velocities is None else found.velocities
        return Samples(heights, velocities)
