"""A horizontal grid of buckets over the triangles of a general mesh, for points and rays."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import FloatArray, IntArray
from smartmesh_ros.terrain.trimesh import TriangleMesh

# Smallest barycentric weight inside a triangle. Slightly negative, so that a point on an edge is in a triangle.
INSIDE = -1e-12
# Largest number of buckets along one side.
MOST_BUCKETS = 2048


class Buckets(NamedTuple):
    """Triangles by bucket: those of bucket b = row * columns + column are ``members[first[b] : first[b + 1]]``.

    ``positions`` (V, 3) [m] of the mesh's vertices; ``triangles`` (T, 3). ``x``, ``y`` [m]: corner of bucket (0, 0);
    ``side`` [m]: of a bucket. ``low``, ``high`` [m]: range of all heights.
    """

    positions: FloatArray
    triangles: IntArray
    x: float
    y: float
    side: float
    rows: int
    columns: int
    first: IntArray
    members: IntArray
    low: float
    high: float


def buckets_of(positions: FloatArray, triangles: IntArray) -> Buckets:
    """Return the triangles (T, 3) of vertices (V, 3) [m] in about as many buckets as there are triangles."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    wide, deep = (max(float(size), 1e-9) for size in (high - low)[:2])
    side = max(math.sqrt(wide * deep / len(triangles)), max(wide, deep) / MOST_BUCKETS)
    rows, columns = int(deep / side) + 1, int(wide / side) + 1
    first = np.zeros(rows * columns + 1, np.int64)
    x, y = float(low[0]), float(low[1])
    count_members(positions, triangles, x, y, side, rows, columns, first)
    np.cumsum(first, out=first)
    members = np.empty(int(first[-1]), np.int64)
    fill_members(positions, triangles, x, y, side, rows, columns, first, members)
    return Buckets(positions, triangles, x, y, side, rows, columns, first, members, float(low[2]), float(high[2]))


@compiled
def bucket_range(positions, triangles, index, x, y, side, rows, columns):
    """Return the first and last row and the first and last column of the buckets that a triangle overlaps."""
    a, b, c = triangles[index, 0], triangles[index, 1], triangles[index, 2]
    west = min(positions[a, 0], positions[b, 0], positions[c, 0])
    east = max(positions[a, 0], positions[b, 0], positions[c, 0])
    south = min(positions[a, 1], positions[b, 1], positions[c, 1])
    north = max(positions[a, 1], positions[b, 1], positions[c, 1])
    left, right = max(int((west - x) / side), 0), min(int((east - x) / side), columns - 1)
    bottom, top = max(int((south - y) / side), 0), min(int((north - y) / side), rows - 1)
    return bottom, top, left, right


@compiled
def count_members(positions, triangles, x, y, side, rows, columns, first):
    """Write the number of triangles of bucket b to ``first[b + 1]``."""
    for index in range(len(triangles)):
        bottom, top, left, right = bucket_range(positions, triangles, index, x, y, side, rows, columns)
        for row in range(bottom, top + 1):
            for column in range(left, right + 1):
                first[row * columns + column + 1] += 1


@compiled
def fill_members(positions, triangles, x, y, side, rows, columns, first, members):
    """Write the triangles of each bucket, in ascending order; see `Buckets`."""
    filled = np.zeros(len(first), np.int64)
    for index in range(len(triangles)):
        bottom, top, left, right = bucket_range(positions, triangles, index, x, y, side, rows, columns)
        for row in range(bottom, top + 1):
            for column in range(left, right + 1):
                bucket = row * columns + column
                members[first[bucket] + filled[bucket]] = index
                filled[bucket] += 1


@compiled
def weights_at(positions, triangles, index, x, y):
    """Return the barycentric weights of the point (x, y) in a triangle seen from above; NaN for a vertical triangle."""
    a, b, c = triangles[index, 0], triangles[index, 1], triangles[index, 2]
    ax, ay = positions[a, 0] - x, positions[a, 1] - y
    bx, by = positions[b, 0] - x, positions[b, 1] - y
    cx, cy = positions[c, 0] - x, positions[c, 1] - y
    u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    area = u + v + w
    if area == 0.0:
        return math.nan, math.nan, math.nan
    return u / area, v / area, w / area


@compiled
def triangle_normal(positions, triangles, index):
    """Return the unit normal (x, y, z) of a triangle on its counter-clockwise side; zero for one without area."""
    a, b, c = triangles[index, 0], triangles[index, 1], triangles[index, 2]
    px, py, pz = (positions[b, 0] - positions[a, 0], positions[b, 1] - positions[a, 1],
                  positions[b, 2] - positions[a, 2])  # fmt: skip
    qx, qy, qz = (positions[c, 0] - positions[a, 0], positions[c, 1] - positions[a, 1],
                  positions[c, 2] - positions[a, 2])  # fmt: skip
    x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 0.0)


def mesh_at(
    mesh: TriangleMesh, points: FloatArray, time: float, z: FloatArray, normals: FloatArray, velocities: FloatArray,
    ages: FloatArray,
) -> None:  # fmt: skip
    """Write the highest ground of a mesh under those points (N, 3) [m] whose ``z`` is NaN; see `GroundSamples`."""
    now = mesh.sample(np.arange(mesh.size), time)
    search_buckets(
        buckets_of(now.positions, mesh.triangles),
        now.velocities,
        points,
        time - mesh.time,
        z,
        normals,
        velocities,
        ages,
    )


@compiled
def search_buckets(buckets, rates, points, age, z, normals, velocities, ages):
    """Write the highest triangle under each point (N, 3) whose ``z`` is NaN. ``rates`` (V, 3) [m/s]: of vertices."""
    positions, triangles = buckets.positions, buckets.triangles
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        row, column = math.floor((y - buckets.y) / buckets.side), math.floor((x - buckets.x) / buckets.side)
        if not math.isnan(z[i]) or row < 0 or column < 0 or row >= buckets.rows or column >= buckets.columns:
            continue
        best, top = -1, -math.inf
        bucket = int(row) * buckets.columns + int(column)
        for k in range(buckets.first[bucket], buckets.first[bucket + 1]):
            index = buckets.members[k]
            u, v, w = weights_at(positions, triangles, index, x, y)
            if u >= INSIDE and v >= INSIDE and w >= INSIDE:
                a, b, c = triangles[index, 0], triangles[index, 1], triangles[index, 2]
                height = u * positions[a, 2] + v * positions[b, 2] + w * positions[c, 2]
                if top < height <= points[i, 2]:
                    best, top = index, height
        if best >= 0:
            u, v, w = weights_at(positions, triangles, best, x, y)
            a, b, c = triangles[best, 0], triangles[best, 1], triangles[best, 2]
            for axis in range(3):
                velocities[i, axis] = u * rates[a, axis] + v * rates[b, axis] + w * rates[c, axis]
            normals[i, 0], normals[i, 1], normals[i, 2] = triangle_normal(positions, triangles, best)
            z[i], ages[i] = top, age
