"""What users give to a soil, checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.errors import InputError
from smartmesh_ros.soil.config import SoilType
from smartmesh_ros.soil.layer import Bytes
from smartmesh_ros.soil.soils import soil_named
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain


def map_from(terrain: MainMesh | Terrain, tile: str) -> HeightMap:
    """Return the height map that gives way; raises `InputError`."""
    mesh = Terrain.of(terrain).tile(tile)
    if not isinstance(mesh, HeightMap):
        raise InputError("terrain", "soil needs a height map; general meshes do not give way")
    return mesh


def soils_from(soil: SoilType | str | Sequence[SoilType | str]) -> list[SoilType]:
    """Return one or several soils, which may be names; raises `InputError`."""
    chosen = list(soil) if isinstance(soil, Iterable) and not isinstance(soil, str) else [soil]
    if not all(isinstance(each, SoilType | str) for each in chosen):
        raise InputError("soil", f"{soil!r} is no soil; give a SoilType, its name, or a list of them")
    if not 1 <= len(chosen) <= 255:
        raise InputError("soil", f"{len(chosen)} soils; a map can have 1 to 255")
    return [soil_named(each) if isinstance(each, str) else each for each in chosen]


def kinds_from(kinds: ArrayLike | None, shape: tuple[int, int], count: int) -> Bytes:
    """Return the map of soils; raises `InputError`."""
    if kinds is None:
        return np.zeros(shape, np.uint8)
    array = np.asarray(kinds)
    if array.shape != shape or array.dtype.kind not in "iub":
        raise InputError("soil", f"kinds are {array.shape} of type {array.dtype}; they must be {shape} integers")
    if array.min() < 0 or array.max() >= count:
        raise InputError("soil", f"kinds are {array.min()} to {array.max()}; there are soils 0 to {count - 1}")
    return array.astype(np.uint8)
