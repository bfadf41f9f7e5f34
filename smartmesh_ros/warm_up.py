"""Has every compiled function ready before it is needed: loaded from Numba's cache, or compiled the first time."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from smartmesh_ros.patches.config import PatchConfig
from smartmesh_ros.physics.shapes import Box, Sphere
from smartmesh_ros.physics.state import BodyState
from smartmesh_ros.physics.world import World, WorldConfig
from smartmesh_ros.terrain.fusion import FusionConfig, fuse, nothing_known
from smartmesh_ros.terrain.heightmap import HeightMap
from smartmesh_ros.terrain.terrain import MainMesh, Terrain
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles

# Samples on a side of the maps, and how far they are apart [m].
SIDE, SPACING = 8, 0.25
MIDDLE = 0.5 * (SIDE - 1) * SPACING


def warm_up() -> float:
    """Runs small worlds that pass through all compiled functions; returns the time it took [s].

    Whoever steps a `World` or updates a `Ground` by a clock calls it before; else the first steps take so long.
    """
    start = perf_counter()
    _warm_up_maps()
    _warm_up_bodies()
    _warm_up_tiles()
    _warm_up_fixed_patches()
    _warm_up_general_mesh()
    _warm_up_fusion()
    return perf_counter() - start


def _hills() -> HeightMap:
    """A height map that is nowhere flat."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    return HeightMap((0.1 * np.sin(rows) * np.cos(columns)).astype(np.float32), resolution=SPACING)


def _warm_up_maps() -> None:
    """Taking maps and regions in, their velocities told or given, and reading them where they slide."""
    heightmap = _hills()
    heightmap.replace(heightmap.heights, time=0.1)
    heightmap.update_region(1, 1, heightmap.heights[1:3, 1:3], time=0.2)
    heightmap.replace(heightmap.heights, time=0.3, velocities=np.ones((SIDE, SIDE), np.float32))
    heightmap.slide((1.0, 0.0), 0.1)
    heightmap.at([[MIDDLE, MIDDLE]], 0.31)
    heightmap.sample(np.arange(4), 0.31)


def _warm_up_bodies() -> None:
    """Supports and colliders of bodies: fields, planes, none; clamped before impact, and put back from below."""
    with _world(_hills()) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((MIDDLE, MIDDLE, 0.2), linear=(0.0, 0.0, -20.0)))
        world.spawn("box", Box(0.2, 0.2, 0.2), 1.0, BodyState((MIDDLE + 0.4, MIDDLE, 0.25)))
        world.spawn("below", Sphere(0.1), 1.0, BodyState((MIDDLE, MIDDLE - 0.4, -0.3)))
        world.step(2)
    with _world(HeightMap(np.zeros((SIDE, SIDE), np.float32), resolution=SPACING)) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((MIDDLE, MIDDLE, 0.1)))
        world.step(2)


def _warm_up_tiles() -> None:
    """Supports across the edge of a tile."""
    left, right = _hills(), _hills()
    terrain = Terrain(left)
    terrain.put("right", HeightMap(right.heights, resolution=SPACING, origin=((SIDE - 1) * SPACING, 0.0)))
    with _world(terrain) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState(((SIDE - 1) * SPACING, MIDDLE, 0.1)))
        world.refresh()


def _warm_up_fixed_patches() -> None:
    """Patches of fixed extent, which bodies with dictated poses have too."""
    with _world(_hills(), PatchConfig(rings=1)) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((MIDDLE, MIDDLE, 0.1)))
        world.refresh()


def _warm_up_general_mesh() -> None:
    """Patches of general meshes."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    vertices = SPACING * np.stack([columns, rows, 0.1 * rows], axis=-1).reshape(-1, 3)
    with _world(TriangleMesh(vertices, grid_triangles(SIDE, SIDE)), PatchConfig(search="brute_force")) as world:
        world.spawn("ball", Sphere(0.1), 1.0, BodyState((MIDDLE, MIDDLE, 0.2)))
        world.refresh()


def _warm_up_fusion() -> None:
    """Maps fused with one variance for all samples, and with one for each."""
    heights = np.zeros((SIDE, SIDE), np.float32)
    fuse(nothing_known(SIDE, SIDE), heights, 1e-4, 0.1, FusionConfig())
    fuse(nothing_known(SIDE, SIDE), heights, np.full((SIDE, SIDE), 1e-4, np.float32), 0.1, FusionConfig())


def _world(terrain: MainMesh | Terrain, patch: PatchConfig | None = None) -> World:
    return World(terrain, WorldConfig(patch=patch or PatchConfig()))
