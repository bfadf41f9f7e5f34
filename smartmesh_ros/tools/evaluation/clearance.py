"""Distance between the surface of a body and the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.ground.quaternions import rotated
from smartmesh_ros.ground.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.distance import Surface, nearest

# Numbers of samples: along the longest edge of a box, and around the rim of a cylinder.
SAMPLES = 8
RIM = 24


@dataclass(frozen=True)
class Skin:
    """A body as spheres of ``radius`` [m] around ``points`` (M, 3) [m] in its own frame.

    Exact for spheres. The points of a capsule lie along its axis; those of boxes and cylinders on the surface, with
    radius zero.
    """

    points: FloatArray
    radius: float


@lru_cache
def skin(shape: Shape) -> Skin:
    """Return the sampled surface of a shape."""
    if isinstance(shape, Sphere):
        return Skin(np.zeros((1, 3)), shape.radius)
    if isinstance(shape, Capsule):
        points = np.zeros((2 * SAMPLES + 1, 3))
        points[:, 2] = np.linspace(-0.5 * shape.height, 0.5 * shape.height, len(points))
        return Skin(points, shape.radius)
    if isinstance(shape, Box):
        return Skin(_box_points(shape), 0.0)
    return Skin(_cylinder_points(shape), 0.0)


def _box_points(box: Box) -> FloatArray:
    """Return the points of a grid on every face, including corners and edges."""
    edges = np.array([box.x, box.y, box.z])
    counts = np.maximum(np.ceil(SAMPLES * edges / edges.max()).astype(int), 1) + 1
    axes = [np.linspace(-0.5 * edge, 0.5 * edge, count) for edge, count in zip(edges, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(grid[(np.abs(np.abs(grid) - 0.5 * edges) < 1e-12).any(axis=1)])


def _cylinder_points(cylinder: Cylinder) -> FloatArray:
    """Return points on rings along the side, including both rims, and on the two caps."""
    angle = 2.0 * math.pi * np.arange(RIM) / RIM
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lines = max(2, math.ceil(SAMPLES * cylinder.height / max(cylinder.height, 2.0 * cylinder.radius)) + 1)
    levels = np.linspace(-0.5 * cylinder.height, 0.5 * cylinder.height, lines)
    side = [np.column_stack([cylinder.radius * ring, np.full(RIM, z)]) for z in levels]
    caps = [
        np.column_stack([share * cylinder.radius * ring, np.full(RIM, z)])
        for z in (levels[0], levels[-1])
        for share in (0.0, 0.5)
    ]
    return np.unique(np.concatenate(side + caps).round(12), axis=0)


def clearances(
    surface: Surface, shape: Shape, positions: FloatArray, orientations: FloatArray, reach: float = 0.1
) -> FloatArray:
    """Return the signed distances (N,) [m] from the surface of bodies to the ground; negative = penetration depth.

    ``positions``: (N, 3) [m]. ``orientations``: (N, 4). Distances are clamped to ``reach`` [m] from the skin's points.
    """
    sample = skin(shape)
    points = positions[:, None] + rotated(orientations[:, None], sample.points)
    chosen = _lowest_points(surface, points)
    distance = np.full(points.shape[:2], np.inf)
    distance[chosen] = nearest(surface, points[chosen], sample.radius + reach).distance
    return np.asarray(distance.min(axis=1) - sample.radius)


def _lowest_points(surface: Surface, points: FloatArray) -> NDArray[np.bool_]:
    """Return True (N, M) for the points (N, M, 3) that may be the nearest ones of their body to the ground.

    If no slope exceeds s, a distance lies between the vertical gap and the gap times 1 / sqrt(1 + s^2).
    """
    gap = points[..., 2] - surface.below(points.reshape(-1, 3)).reshape(points.shape[:2])
    cosine = 1.0 / math.sqrt(1.0 + surface.steepest**2)
    least, most = np.where(gap > 0.0, gap * cosine, gap), np.where(gap > 0.0, gap, gap * cosine)
    unknown = np.isnan(gap)
    most[unknown], least[unknown] = np.inf, -np.inf  # points beside the map may still be near the ground
    return np.asarray(least <= most.min(axis=1, keepdims=True))
