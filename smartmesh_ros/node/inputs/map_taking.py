"""Puts a whole map of any message or file into the terrain. Without ROS."""

from __future__ import annotations

from smartmesh_ros.io.rasters import FloatGrid, Raster
from smartmesh_ros.node.inputs.bounds import require_tile_fits
from smartmesh_ros.node.parameters.settings import Settings
from smartmesh_ros.patches.config import require_usable
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import Terrain


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
