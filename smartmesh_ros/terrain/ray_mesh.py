"""Rays onto a general mesh: a traversal of the buckets of its triangles, and the test of a ray and a triangle by Möller
and Trumbore (*Fast, Minimum Storage Ray/Triangle Intersection*, 1997)."""

from __future__ import annotations

import math

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.mesh_buckets import Buckets, triangle_normal
from smartmesh_ros.terrain.ray_grid import clipped, leaves

# Smallest barycentric weight of a hit, slightly negative: a ray through an edge hits one of its triangles.
INSIDE = -1e-12


@compiled
def cast_on_mesh(
    buckets: Buckets, origins: FloatArray, directions: FloatArray, reach: float, distances: FloatArray,
    normals: FloatArray,
) -> None:  # fmt: skip
    """Write ``distances`` (N,) [m] and ``normals`` (N, 3) of the rays that meet a mesh within ``reach`` [m] and before
    their distance so far. ``origins`` (N, 3) [m]; ``directions`` (N, 3): unit vectors."""
    for i in range(len(origins)):
        limit = min(reach, distances[i])
        row, column = (origins[i, 1] - buckets.y) / buckets.side, (origins[i, 0] - buckets.x) / buckets.side
        per_row, per_column = directions[i, 1] / buckets.side, directions[i, 0] / buckets.side
        begin, end = clipped(row, per_row, buckets.rows, 0.0, limit)
        begin, end = clipped(column, per_column, buckets.columns, begin, end)
        if begin > end:
            continue
        r = int(min(max(math.floor(row + per_row * begin), 0), buckets.rows - 1))
        c = int(min(max(math.floor(column + per_column * begin), 0), buckets.columns - 1))
        best, nearest = -1, math.inf
        while 0 <= r < buckets.rows and 0 <= c < buckets.columns and begin <= end:
            leave_row, leave_column = leaves(row, per_row, r, r + 1), leaves(column, per_column, c, c + 1)
            bucket = r * buckets.columns + c
            for k in range(buckets.first[bucket], buckets.first[bucket + 1]):
                index = buckets.members[k]
                distance = distance_to(buckets.positions, buckets.triangles, index, origins[i], directions[i])
                if distance < nearest:
                    best, nearest = index, distance
            begin = min(leave_row, leave_column)
            if nearest <= begin:
                break
            if leave_row <= leave_column:
                r += 1 if per_row > 0.0 else -1
            if leave_column <= leave_row:
                c += 1 if per_column > 0.0 else -1
        if best >= 0 and nearest <= limit and nearest < distances[i]:
            distances[i] = nearest
            normals[i, 0], normals[i, 1], normals[i, 2] = triangle_normal(buckets.positions, buckets.triangles, best)


@compiled
def distance_to(
    positions: FloatArray, triangles: IntArray, index: int, origin: FloatArray, direction: FloatArray
) -> float:
    """Return the distance [m] along a ray to a triangle, infinity if the ray does not meet it."""
    a, b, c = triangles[index, 0], triangles[index, 1], triangles[index, 2]
    px, py, pz = (positions[b, 0] - positions[a, 0], positions[b, 1] - positions[a, 1],
                  positions[b, 2] - positions[a, 2])  # fmt: skip
    qx, qy, qz = (positions[c, 0] - positions[a, 0], positions[c, 1] - positions[a, 1],
                  positions[c, 2] - positions[a, 2])  # fmt: skip
    x, y, z = direction[0], direction[1], direction[2]
    hx, hy, hz = y * qz - z * qy, z * qx - x * qz, x * qy - y * qx
    determinant = px * hx + py * hy + pz * hz
    if determinant == 0.0:
        return math.inf
    sx, sy, sz = origin[0] - positions[a, 0], origin[1] - positions[a, 1], origin[2] - positions[a, 2]
    u = (sx * hx + sy * hy + sz * hz) / determinant
    kx, ky, kz = sy * pz - sz * py, sz * px - sx * pz, sx * py - sy * px
    v = (x * kx + y * ky + z * kz) / determinant
    if not (u >= INSIDE and v >= INSIDE and u + v <= 1.0 - INSIDE):
        return math.inf
    distance = (qx * kx + qy * ky + qz * kz) / determinant
    return distance if distance >= 0.0 else math.inf
