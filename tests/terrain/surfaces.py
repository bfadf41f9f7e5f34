"""The surface of a main mesh as triangles, and points and rays on it by brute force: written without the package's
sampling of facets."""

from typing import NamedTuple

import numpy as np

from smartmesh_ros import HeightMap


class Found(NamedTuple):
    """Heights or distances (N,), and unit normals (N, 3); NaN or infinity = nothing."""

    values: np.ndarray
    normals: np.ndarray


def triangles_of(heightmap: HeightMap, time: float) -> np.ndarray:
    """Corners (T, 3, 3) of all facets without holes."""
    geometry = heightmap.geometry
    r, c = np.mgrid[: geometry.rows, : geometry.columns]
    z = heightmap.sample((r * geometry.columns + c).reshape(-1), time).heights.reshape(r.shape)
    vertices = np.concatenate([heightmap.placed_at(time).to_world(r, c), z[..., None]], axis=-1)
    near, right, above, far = vertices[:-1, :-1], vertices[:-1, 1:], vertices[1:, :-1], vertices[1:, 1:]
    both = [np.stack([near, right, far], axis=-2), np.stack([near, far, above], axis=-2)]
    facets = np.concatenate([part.reshape(-1, 3, 3) for part in both])
    return facets[np.isfinite(facets).all(axis=(1, 2))]


def normals_of(facets: np.ndarray) -> np.ndarray:
    """Unit normals (T, 3) on the counter-clockwise side."""
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def highest(facets: np.ndarray, points: np.ndarray, slack: float = 1e-9) -> Found:
    """The highest facet under each point (N, 3), at most as high as the point."""
    values, normals = np.full(len(points), np.nan), np.full((len(points), 3), np.nan)
    own = normals_of(facets)
    # Facets whose bounding boxes are beside a point are not under it.
    low, high = facets[:, :, :2].min(axis=1) - 1e-6, facets[:, :, :2].max(axis=1) + 1e-6
    west, south, east, north = (np.ascontiguousarray(side) for side in (*low.T, *high.T))
    for i, (x, y, top) in enumerate(points):
        near = np.flatnonzero((west <= x) & (x <= east) & (south <= y) & (y <= north))
        a, b, c = (facets[near, k, :2] - (x, y) for k in range(3))
        u, v, w = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b)))
        area = u + v + w
        with np.errstate(divide="ignore", invalid="ignore"):
            weights = np.stack([u, v, w], axis=1) / area[:, None]
        z = (weights * facets[near, :, 2]).sum(axis=1)
        inside = (weights >= -slack).all(axis=1) & (z <= top)
        if inside.any():
            best = np.flatnonzero(inside)[z[inside].argmax()]
            values[i], normals[i] = z[best], own[near[best]]
    return Found(values, normals)


def first_hit(facets: np.ndarray, origins: np.ndarray, directions: np.ndarray, reach: float) -> Found:
    """The first facet that each ray meets, from either side: its plane, then the signs of three volumes."""
    values, normals = np.full(len(origins), np.inf), np.full((len(origins), 3), np.nan)
    own = normals_of(facets)
    for i, (start, way) in enumerate(zip(origins, directions, strict=True)):
        unit = way / np.linalg.norm(way)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = ((facets[:, 0] - start) * own).sum(axis=1) / (own @ unit)
        a, b, c = (facets[:, k] - start for k in range(3))
        volumes = np.stack([np.cross(p, q) @ unit for p, q in ((a, b), (b, c), (c, a))])
        inside = (volumes >= -1e-12).all(axis=0) | (volumes <= 1e-12).all(axis=0)
        hit = np.flatnonzero(inside & (s >= 0.0) & (s <= reach))
        if hit.size:
            best = hit[s[hit].argmin()]
            values[i], normals[i] = s[best], own[best]
    return Found(values, normals)
