"""Rays cast onto the surface of a height map."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.ray_cast import RayCaster, checked_rays
from smartmesh_ros.terrain.terrain import Terrain
from smartmesh_ros.tools.evaluation.distance import Surface


def cast_rays(surface: Surface, start_w: FloatArray, directions_w: FloatArray, reach: float) -> FloatArray:
    """Distance (N,) [m] from ``start_w`` (3,) [m], above the ground, to the ground along unit ``directions_w`` (N, 3).

    NaN where none is met within ``reach`` [m] and inside the map. Rays go through holes.
    """
    terrain = Terrain(HeightMap(surface.heights, geometry=surface.geometry))
    rays = checked_rays(np.broadcast_to(start_w, directions_w.shape), directions_w, reach)
    found = RayCaster(terrain).cast(rays, 0.0).distances
    return np.where(np.isfinite(found), found, np.nan)
