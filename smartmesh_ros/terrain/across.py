"""Samples of a height map's lattice, continued beyond its edge over the neighbour tiles."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.terrain.grid import IntArray
from smartmesh_ros.terrain.heightmap import HeightMap, Samples
from smartmesh_ros.terrain.motion import INSTANT
from smartmesh_ros.terrain.terrain import Terrain


def samples_across(
    terrain: Terrain, heightmap: HeightMap, rows: IntArray, columns: IntArray, time: float, ahead: float = INSTANT
) -> Samples:
    """Samples (n, K) of a map at ``time`` [s], with mean velocities over the time ``ahead`` [s]. Samples beyond the
    map's edge are read from its neighbour tiles, NaN = no tile."""
    geometry = heightmap.geometry
    inside = (rows >= 0) & (columns >= 0) & (rows < geometry.rows) & (columns < geometry.columns)
    indices = np.where(inside, rows * geometry.columns + columns, 0)
    samples = heightmap.sample(indices, time, ahead)
    outside = ~inside
    if outside.any():
        samples.heights[outside], samples.velocities[outside] = np.nan, 0.0
        if len(terrain.tiles) > 1:
            beyond = terrain.at(heightmap.placed_at(time).to_world(rows[outside], columns[outside]), time)
            samples.heights[outside], samples.velocities[outside] = beyond
    return samples
