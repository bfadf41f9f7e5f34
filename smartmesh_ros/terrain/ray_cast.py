"""Rays onto the ground: the surface that bodies stand on, at any instant."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import MAX_COORDINATE, FloatArray
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.memory import untouched_zeros
from smartmesh_ros.terrain.mesh_buckets import Buckets, buckets_of
from smartmesh_ros.terrain.ray_grid import SIDE, TILE, RayTiles, cast_on_grid
from smartmesh_ros.terrain.ray_mesh import cast_on_mesh
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh


class GroundHits(NamedTuple):
    """What N rays meet: ``distances`` (N,) [m], infinity = no ground; ``normals`` (N, 3): unit normals of the facets,
    towards the side of the bodies, NaN = no ground."""

    distances: FloatArray
    normals: FloatArray


class Rays(NamedTuple):
    """N rays: ``origins`` (N, 3) [m], unit ``directions`` (N, 3), and their length ``reach`` [m]."""

    origins: FloatArray
    directions: FloatArray
    reach: float

    def part(self, chosen: slice) -> Rays:
        """Return some of the rays."""
        return Rays(self.origins[chosen], self.directions[chosen], self.reach)


def checked_rays(origins: ArrayLike, directions: ArrayLike, reach: float) -> Rays:
    """Return rays with directions of length one. Raises `InputError`."""
    starts, ways = (np.array(values, np.float64, order="C") for values in (origins, directions))
    if starts.ndim != 2 or starts.shape[1] != 3 or starts.shape != ways.shape:
        raise InputError(
            "length", f"origins have shape {starts.shape} and directions {ways.shape}; both must be (N, 3)"
        )
    if not (np.isfinite(starts).all() and np.isfinite(ways).all()):
        raise InputError(
            "non_finite", "origins or directions contain numbers that are not finite; every number must be"
        )
    if np.abs(starts).max(initial=0.0) > MAX_COORDINATE:
        raise InputError("geometry", f"origins are up to {np.abs(starts).max():g} m away; at most {MAX_COORDINATE:g}")
    if not 0.0 < reach <= MAX_COORDINATE:
        raise InputError(
            "range", f"the range of the rays is {reach} m; it must be above zero, at most {MAX_COORDINATE:g}"
        )
    sizes = np.abs(ways).max(axis=1, initial=0.0)
    if not (sizes > 0.0).all():
        raise InputError("direction", f"direction {int(sizes.argmin())} has no length; every direction needs one")
    ways /= sizes[:, None]  # lengths of very large numbers would overflow
    return Rays(starts, ways / np.linalg.norm(ways, axis=1, keepdims=True), float(reach))


class RayCaster:
    """Casts rays onto a terrain. Heights of one instant are kept until the ground has moved on."""

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain
        self._grids: dict[str, _Grid] = {}
        self._meshes: dict[str, _Mesh] = {}

    def cast(self, rays: Rays, time: float) -> GroundHits:
        """Return where rays meet the ground at ``time`` [s], from either side. They pass through holes. Where tiles
        overlap, a ray meets the surface that it reaches first."""
        hits = GroundHits(np.full(len(rays.origins), np.inf), np.full((len(rays.origins), 3), np.nan))
        tiles = self._terrain.tiles
        self._grids = {name: kept for name, kept in self._grids.items() if tiles.get(name) is kept.heightmap}
        self._meshes = {name: kept for name, kept in self._meshes.items() if tiles.get(name) is kept.mesh}
        for name, mesh in tiles.items():
            if isinstance(mesh, HeightMap):
                if name not in self._grids or self._grids[name].pad != self._pad:
                    self._grids[name] = _Grid(mesh, self._pad)
                cast_on_grid(mesh.moved_to(time), self._grids[name].at(self._terrain, time), time, *rays, *hits)
            else:
                if name not in self._meshes:
                    self._meshes[name] = _Mesh(mesh)
                cast_on_mesh(self._meshes[name].at(time), *rays, *hits)
        return hits

    @property
    def _pad(self) -> int:
        return 1 if len(self._terrain.tiles) > 1 else 0


class _Grid:
    """The tiles of a height map, for the instant of the last rays."""

    def __init__(self, heightmap: HeightMap, pad: int) -> None:
        self.heightmap, self.pad = heightmap, pad
        rows, columns = heightmap.geometry.rows, heightmap.geometry.columns
        high, wide = (-(-(samples - 1 + 2 * pad) // TILE) for samples in (rows, columns))
        self._tiles = RayTiles(
            heights=untouched_zeros((high * wide, 2 * SIDE * SIDE)).view(np.float64), low=np.zeros((high, wide)),
            high=np.zeros((high, wide)), filled=np.zeros((high, wide), np.uint8), pad=pad,
            rim=np.full((4, pad * (max(rows, columns) + 2)), np.nan), others=np.empty((0, 6)),
            window=np.empty((SIDE, SIDE)),
        )  # fmt: skip
        self._key: Any = None

    def at(self, terrain: Terrain, time: float) -> RayTiles:
        """Return the tiles for rays at ``time`` [s]; those of the last instant stay valid if the ground is at rest."""
        key = _state(terrain if self.pad else self.heightmap, time)
        if key != self._key:
            self._key = key
            self._tiles.filled[:] = 0
            if self.pad:
                self._tiles = self._tiles._replace(others=_extents(terrain, self.heightmap, time))
                _read_rim(terrain, self.heightmap, time, self._tiles.rim)
        return self._tiles


class _Mesh:
    """The buckets of a general mesh, for the instant of the last rays."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self._key: Any = None
        self._buckets: Buckets | None = None

    def at(self, time: float) -> Buckets:
        """Return the buckets for rays at ``time`` [s]."""
        key = _state(self.mesh, time)
        if key != self._key or self._buckets is None:
            self._key = key
            self._buckets = buckets_of(self.mesh.sample(np.arange(self.mesh.size), time).positions, self.mesh.triangles)
        return self._buckets


def _state(ground: Terrain | MainMesh, time: float) -> tuple[int, float, float]:
    """Return a key that changes with the ground: its revision, and the time unless it is at rest."""
    meshes = ground.tiles.values() if isinstance(ground, Terrain) else [ground]
    shown = max((mesh.shown for mesh in meshes if isinstance(mesh, HeightMap)), default=0.0)
    moving = any(mesh.moving(time) for mesh in meshes)
    return (ground.revision, time, shown) if moving else (ground.revision, 0.0, 0.0)


def _extents(terrain: Terrain, own: HeightMap, time: float) -> FloatArray:
    """Return the places of the other height maps; see `RayTiles`."""
    found = []
    for mesh in terrain.tiles.values():
        if isinstance(mesh, HeightMap) and mesh is not own:
            grid, geometry = mesh.moved_to(time), mesh.geometry
            wide, deep = ((samples - 1) * geometry.resolution for samples in (geometry.columns, geometry.rows))
            found.append((grid.x, grid.y, grid.cos, grid.sin, wide, deep))
    return np.array(found, np.float64).reshape(-1, 6)


def _read_rim(terrain: Terrain, heightmap: HeightMap, time: float, rim: FloatArray) -> None:
    """Write the heights of the samples around a map, read from its neighbour tiles; see `RayTiles`."""
    geometry = heightmap.geometry
    placed = heightmap.placed_at(time)
    rows, columns = np.arange(-1, geometry.rows + 1), np.arange(-1, geometry.columns + 1)
    lines: list[tuple[NDArray[np.int64] | int, NDArray[np.int64] | int]] = [
        (-1, columns), (geometry.rows, columns), (rows, -1), (rows, geometry.columns),
    ]  # fmt: skip
    for line, (row, column) in zip(rim, lines, strict=True):
        points = placed.to_world(*np.broadcast_arrays(row, column))
        line[: len(points)] = terrain.around(points, time).heights
