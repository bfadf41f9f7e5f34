"""Height, normal, velocity and age of the ground at points: the surface that bodies stand on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.across import samples_across
from smartmesh_ros.terrain.correction import BLOCK_SHIFT
from smartmesh_ros.terrain.facet_at import facet_at_sample, facet_of_cell
from smartmesh_ros.terrain.grid import MAX_COORDINATE, BoolArray, FloatArray, IntArray
from smartmesh_ros.terrain.heightmap import EDGE, HeightMap
from smartmesh_ros.terrain.masked import unmasked
from smartmesh_ros.terrain.mesh_buckets import mesh_at
from smartmesh_ros.terrain.moving_grid import MovingGrid, slide_at, to_grid
from smartmesh_ros.terrain.terrain import Terrain


class GroundSamples(NamedTuple):
    """The ground at N points.

    ``z`` (N,) [m], NaN = no ground. Where there is none, the other arrays are NaN too. ``normals`` (N, 3): unit normals
    of the facets, towards the side of the bodies. ``velocities`` (N, 3) [m/s]: of the ground itself, horizontal motion
    included. ``ages`` (N,) [s]: time since the last map of the place, negative before it.
    """

    z: FloatArray
    normals: FloatArray
    velocities: FloatArray
    ages: FloatArray


def no_ground(count: int) -> GroundSamples:
    """Return samples of points without ground."""
    return GroundSamples(
        np.full(count, np.nan), np.full((count, 3), np.nan), np.full((count, 3), np.nan), np.full(count, np.nan)
    )


def checked_points(points: ArrayLike) -> FloatArray:
    """Return points as (N, 3) [m]; points (N, 2) get z = infinity. Raises `InputError`."""
    array = unmasked(points)
    if array.ndim != 2 or array.shape[1] not in (2, 3) or array.dtype.kind not in "fiu":
        raise InputError(
            "length", f"points have shape {array.shape}; they must be real numbers of shape (N, 2) or (N, 3)"
        )
    whole = np.full((len(array), 3), np.inf)
    whole[:, : array.shape[1]] = array
    if not np.isfinite(whole[:, :2]).all() or np.isnan(whole[:, 2]).any():
        raise InputError("non_finite", "points contain numbers that are not finite; every coordinate must be")
    if np.abs(whole[:, :2]).max(initial=0.0) > MAX_COORDINATE:
        farthest = np.abs(whole[:, :2]).max()
        raise InputError("geometry", f"points are up to {farthest:g} m away; at most {MAX_COORDINATE:g} is possible")
    return whole


def ground_samples(terrain: Terrain, points_w: FloatArray, time: float) -> GroundSamples:
    """Return the ground under points (N, 3) [m] at ``time`` [s].

    The result at a point is that of the first tile with ground there. Ground above a point does not count, so z =
    infinity asks for the highest ground. Gaps of up to a cell between tiles are ground, as for bodies.
    """
    found = no_ground(len(points_w))
    for mesh in terrain.tiles.values():
        if isinstance(mesh, HeightMap):
            grid_at(mesh.moved_to(time), points_w, time, *found)
        else:
            mesh_at(mesh, points_w, time, *found)
    if len(terrain.tiles) > 1:
        _add_gaps(terrain, points_w, time, found)
    return found


@compiled
def grid_at(
    grid: MovingGrid, points: FloatArray, time: float, z: FloatArray, normals: FloatArray, velocities: FloatArray,
    ages: FloatArray,
) -> None:  # fmt: skip
    """Write the ground of a map under those points (N, 3) [m] whose ``z`` is NaN; see `GroundSamples`."""
    rows, columns = grid.heights.shape
    corners = np.empty((2, 4))
    for i in range(len(points)):
        if not math.isnan(z[i]):
            continue
        x, y = points[i, 0], points[i, 1]
        row, column = to_grid(grid, x, y)
        beyond = max(-row, row - (rows - 1.0), -column, column - (columns - 1.0))
        if not beyond <= EDGE:
            continue
        row, column = min(max(row, 0.0), rows - 1.0), min(max(column, 0.0), columns - 1.0)
        facet = facet_at_sample(grid, row, column, time, corners)
        if facet.z <= points[i, 2]:
            clock = grid.clocks[int(row) >> BLOCK_SHIFT, int(column) >> BLOCK_SHIFT]
            write_sample(grid, i, x, y, facet, time - clock.time, z, normals, velocities, ages)


@compiled
def write_sample(grid, i, x, y, facet, age, z, normals, velocities, ages):
    """Write row ``i`` of the ground from a facet in the grid's frame."""
    z[i], ages[i] = facet.z, age
    east, north = -facet.per_column / grid.resolution, -facet.per_row / grid.resolution
    up = 1.0 / math.sqrt(1.0 + east * east + north * north)
    normals[i, 0] = (east * grid.cos - north * grid.sin) * up
    normals[i, 1] = (east * grid.sin + north * grid.cos) * up
    normals[i, 2] = up
    slide_x, slide_y = slide_at(grid, x, y)
    velocities[i, 0], velocities[i, 1], velocities[i, 2] = slide_x, slide_y, facet.rise


def _add_gaps(terrain: Terrain, points_w: FloatArray, time: float, found: GroundSamples) -> None:
    """Write the ground in gaps between tiles: the facets of the nearest map's lattice, continued over its neighbours,
    as the patches of bodies on that map."""
    open_points = np.flatnonzero(np.isnan(found.z) & _outside_all(terrain, points_w))
    maps = [mesh for mesh in terrain.tiles.values() if isinstance(mesh, HeightMap)]
    if not open_points.size or not maps:
        return
    beyond = np.array([heightmap.beyond(points_w[open_points]) for heightmap in maps])
    nearest = beyond.argmin(axis=0)
    for index, heightmap in enumerate(maps):
        near = open_points[(nearest == index) & (beyond[index] <= terrain.widest_cell * (1.0 + 1e-6))]
        if near.size:
            _add_gaps_of(terrain, heightmap, near, points_w, time, found)


def _add_gaps_of(
    terrain: Terrain, heightmap: HeightMap, near: IntArray, points_w: FloatArray, time: float, found: GroundSamples
) -> None:
    place = heightmap.placed_at(time).to_grid(points_w[near, :2])
    cells = np.floor(place).astype(np.int64)
    corners = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    rows, columns = (cells[:, axis, None] + corners[:, axis] for axis in (0, 1))
    heights, rises = samples_across(terrain, heightmap, rows, columns, time)
    grid = heightmap.moved_to(time)
    for k, i in enumerate(near.tolist()):
        v, u = (place[k] - cells[k]).tolist()
        facet = facet_of_cell(np.stack([heights[k], rises[k]]), v, u, 0 if u >= v else 1)
        if facet.z <= points_w[i, 2]:
            write_sample(grid, i, points_w[i, 0], points_w[i, 1], facet, time - heightmap.time, *found)


def _outside_all(terrain: Terrain, points_w: FloatArray) -> BoolArray:
    """Return True for points (N,) that lie on no tile; a hole inside a tile is no gap."""
    outside = np.ones(len(points_w), bool)
    for mesh in terrain.tiles.values():
        outside &= mesh.beyond(points_w) > 0.0
    return outside
