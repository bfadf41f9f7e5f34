"""Ray cast: a vertical ray from the body onto its previous patch (the report's first implementation).

The search needs a body above its previous patch. If the ray misses, the caller falls back to brute force, as the report
does. The ray is intersected with the patch's triangles here and not by the engine, because patches collide with their
own body only and so are invisible to the engine's rays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray, IntArray

# Smallest barycentric weight of a hit. Slightly negative, so that a ray at an edge hits one of the two triangles.
ON_EDGE = -1e-9


def ray_cast(positions_w: FloatArray, vertices_w: FloatArray, triangles: NDArray[np.integer]) -> IntArray:
    """Return the vertex (N,) of each patch, 0 .. K - 1, nearest to the hit of a ray down from its body; -1 = no hit.

    ``positions_w``: (N, 3) [m]. ``vertices_w``: (N, K, 3) [m]. ``triangles``: (T, 3) corners among the K vertices, the
    same for all patches. Distances from the hit are horizontal; ties go to the lower vertex.
    """
    corners = vertices_w[:, triangles]  # (N, T, 3, 3)
    a, b, c = (corners[:, :, corner] for corner in range(3))
    x, y = positions_w[:, None, 0], positions_w[:, None, 1]
    area = (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        v = ((x - a[..., 0]) * (c[..., 1] - a[..., 1]) - (y - a[..., 1]) * (c[..., 0] - a[..., 0])) / area
        w = ((b[..., 0] - a[..., 0]) * (y - a[..., 1]) - (b[..., 1] - a[..., 1]) * (x - a[..., 0])) / area
        u = 1.0 - v - w
        height = u * a[..., 2] + v * b[..., 2] + w * c[..., 2]
        hit = (u >= ON_EDGE) & (v >= ON_EDGE) & (w >= ON_EDGE) & (height <= positions_w[:, None, 2])
    # If a patch overlaps itself, the ray hits the highest triangle first. Equally high triangles share the nearest
    # corner.
    first = np.where(hit, height, -np.inf).argmax(axis=1)
    row = np.arange(len(first))
    options = np.sort(triangles[first].astype(np.int64), axis=1)
    place = vertices_w[row[:, None], options, :2]
    distance = ((place - positions_w[:, None, :2]) ** 2).sum(axis=2)
    return np.where(hit[row, first], options[row, distance.argmin(axis=1)], -1)
