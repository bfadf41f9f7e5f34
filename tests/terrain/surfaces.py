"""Ground as triangles; points, rays and distances by brute force, written without the package's sampling of facets."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros import HeightMap, MotionConfig
from smartmesh_ros.terrain.trimesh import TriangleMesh, grid_triangles


class Found(NamedTuple):
    """Heights or distances (N,), and unit normals (N, 3); NaN or infinity = nothing."""

    values: np.ndarray
    normals: np.ndarray


def told(maps: Sequence[np.ndarray], times: Iterable[float], motion: MotionConfig | None = None) -> HeightMap:
    """A map that was told these heights [m] at these times [s]; its samples are 1 m apart."""
    (first, start), *later = zip(maps, times, strict=True)
    heightmap = HeightMap(first, resolution=1.0, time=float(start), motion=motion)
    for heights, time in later:
        heightmap.replace(heights, time=float(time))
    return heightmap


def rough_map(seed: int, holes: int = 0, yaw: float = 0.0, motion: MotionConfig | None = None) -> HeightMap:
    """Hills with holes, which move: 40 x 70 samples 0.5 m apart, more than one block, after four maps at 50 Hz."""
    rng = np.random.default_rng(seed)
    heights = np.cumsum(rng.normal(scale=0.15, size=(40, 70)), axis=1)
    heights.ravel()[rng.integers(0, heights.size, holes)] = np.nan
    heightmap = HeightMap(heights, resolution=0.5, origin=(-4.0, 3.0, 1.0), yaw=yaw, motion=motion)
    for number in range(1, 4):
        heightmap.replace(heights + 0.1 * number * rng.normal(size=heights.shape), time=0.02 * number)
    return heightmap


def mesh_of(ground: HeightMap, **options: Any) -> TriangleMesh:
    """The ground of a map as a mesh."""
    rows, columns = ground.heights.shape
    places = ground.geometry.to_world(*np.indices((rows, columns)))
    vertices = np.concatenate([places, ground.heights[..., None].astype(np.float64)], axis=-1)
    return TriangleMesh(vertices.reshape(-1, 3), grid_triangles(rows, columns), **options)


def folded_mesh(seed: int) -> TriangleMesh:
    """Two uneven sheets, one above the other, and an upright wall. It moves by 1 m/s along each axis from 0.1 s on."""
    rng = np.random.default_rng(seed)
    r, c = np.mgrid[:12, :9]
    sheet = np.stack([c, r, np.zeros_like(r)], axis=-1).reshape(-1, 3) + rng.uniform(-0.4, 0.4, (108, 3))
    wall = [[2, 3, -2], [2, 9, -2], [2, 9, 5], [2, 3, 5]]
    triangles = grid_triangles(12, 9)
    mesh = TriangleMesh(
        np.concatenate([sheet, sheet * (0.5, 0.5, 1.0) + (1.0, 2.0, 3.0), wall]),
        np.concatenate([triangles, triangles + 108, [[216, 217, 218], [216, 218, 219]]]),
    )
    mesh.move(mesh.vertices + 0.1, time=0.1)
    return mesh


def triangles_of(ground: HeightMap | TriangleMesh, time: float) -> np.ndarray:
    """Corners (T, 3, 3) of all facets without holes."""
    if isinstance(ground, TriangleMesh):
        return np.asarray(ground.sample(np.arange(ground.size), time).positions[ground.triangles])
    geometry = ground.geometry
    r, c = np.mgrid[: geometry.rows, : geometry.columns]
    z = ground.sample((r * geometry.columns + c).reshape(-1), time).heights.reshape(r.shape)
    vertices = np.concatenate([ground.placed_at(time).to_world(r, c), z[..., None]], axis=-1)
    near, right, above, far = vertices[:-1, :-1], vertices[:-1, 1:], vertices[1:, :-1], vertices[1:, 1:]
    both = [np.stack([near, right, far], axis=-2), np.stack([near, far, above], axis=-2)]
    facets = np.concatenate([part.reshape(-1, 3, 3) for part in both])
    return facets[np.isfinite(facets).all(axis=(1, 2))]


def normals_of(facets: np.ndarray) -> np.ndarray:
    """Unit normals (T, 3) on the counter-clockwise side."""
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def first_hit(facets: np.ndarray, origins: np.ndarray, directions: np.ndarray, reach: float) -> Found:
    """The first facet that each ray meets, from either side: its plane, then the signs of three volumes."""
    values, normals = np.full(len(origins), np.inf), np.full((len(origins), 3), np.nan)
    own, low, high = normals_of(facets), facets.min(axis=1) - 1e-6, facets.max(axis=1) + 1e-6
    for i, (start, way) in enumerate(zip(origins, directions, strict=True)):
        unit = way / np.linalg.norm(way)
        ends = np.stack([start, start + reach * unit])
        near = np.flatnonzero(((low <= ends.max(axis=0)) & (high >= ends.min(axis=0))).all(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            s = ((facets[near, 0] - start) * own[near]).sum(axis=1) / (own[near] @ unit)
        a, b, c = (facets[near, k] - start for k in range(3))
        volumes = np.stack([np.cross(p, q) @ unit for p, q in ((a, b), (b, c), (c, a))])
        inside = (volumes >= -1e-12).all(axis=0) | (volumes <= 1e-12).all(axis=0)
        hit = np.flatnonzero(inside & (s >= 0.0) & (s <= reach))
        if hit.size:
            best = hit[s[hit].argmin()]
            values[i], normals[i] = s[best], own[near[best]]
    return Found(values, normals)


def highest(facets: np.ndarray, points: np.ndarray) -> Found:
    """The highest facet under each point (N, 3), at most as high as the point."""
    tops = np.minimum(points[:, 2], facets[..., 2].max() + 1.0)
    origins, down = np.column_stack([points[:, :2], tops]), np.tile([0.0, 0.0, -1.0], (len(points), 1))
    found = first_hit(facets, origins, down, float(np.ptp(facets[..., 2])) + 1.0)
    return Found(np.where(np.isinf(found.values), np.nan, tops - found.values), found.normals)


def facet_distances(facets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The distances (N, T) of points (N, 3) from facets [m]."""
    a, b, c = (facets[:, k] - points[:, None] for k in range(3))
    normals = normals_of(facets)
    inside = np.ones(a.shape[:2], bool)
    best = np.full(a.shape[:2], np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        side = q - p
        inside &= np.einsum("ptj,tj->pt", np.cross(p, q), normals) >= 0.0
        share = np.clip(-np.einsum("ptj,ptj->pt", p, side) / np.einsum("ptj,ptj->pt", side, side), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(p + share[..., None] * side, axis=2))
    planes = np.abs(np.einsum("ptj,tj->pt", a, normals))
    return np.asarray(np.where(inside, planes, best))


def distances(facets: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """The distances (N,) of points (N, 3) from the nearest facet [m], right where they are below ``reach`` [m]."""
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    near = ((facets.min(axis=1) <= high) & (facets.max(axis=1) >= low)).all(axis=1)
    return np.asarray(facet_distances(facets[near], points).min(axis=1, initial=np.inf))
