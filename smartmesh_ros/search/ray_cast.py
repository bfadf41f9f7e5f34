"""Ray cast: a ray straight down onto the local collider of the update before (the report's first implementation).

It only works while a body is above the patch it had; where the ray misses, the caller falls back to brute force, as the
report does. The ray meets the patch's own triangles here, not the engine's: patches collide with their one body alone,
so the engine's rays do not see them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray, IntArray

# A ray that meets an edge is not to slip through between two triangles: barycentric weights from here on hit.
ON_EDGE = -1e-9


def ray_cast(positions_w: FloatArray, vertices_w: FloatArray, triangles: NDArray[np.integer]) -> IntArray:
    """Vertex of each patch that is nearest to where a ray down from its body meets the patch; -1 where it misses.

    ``positions_w``: (N, 3) [m]; ``vertices_w``: (N, K, 3) [m]; ``triangles``: (T, 3) corners among the K, the same for
    all. Distances from the hit are horizontal; ties go to the lower vertex. The result is (N,), in 0 .. K - 1.
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
    # Of several (a patch that overlaps itself) the highest is met first; of equal ones any has the same corner nearest.
    first = np.where(hit, height, -np.inf).argmax(axis=1)
    row = np.arange(len(first))
    options = np.sort(triangles[first].astype(np.int64), axis=1)
    place = vertices_w[row[:, None], options, :2]
    distance = ((place - positions_w[:, None, :2]) ** 2).sum(axis=2)
    return np.where(hit[row, first], options[row, distance.argmin(axis=1)], -1)
