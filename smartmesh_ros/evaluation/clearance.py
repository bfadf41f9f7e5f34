"""How far the surface of a body is from the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.evaluation.distance import Surface, nearest
from smartmesh_ros.physics.shapes import Box, Capsule, Cylinder, Shape, Sphere
from smartmesh_ros.terrain.grid import FloatArray

# Samples along the longest edge of a box, and around the rim of a cylinder.
SAMPLES = 8
RIM = 24


@dataclass(frozen=True)
class Skin:
    """A body as spheres of ``radius`` [m] around ``points`` (M, 3) [m] in its own frame.

    Exact for a sphere; dense along a capsule's axis; radius zero and points on the surface for boxes and cylinders.
    """

    points: FloatArray
    radius: float


@lru_cache
def skin(shape: Shape) -> Skin:
    """The sampled surface of a shape."""
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
    """A grid on every face; corners and edges are among its points."""
    edges = np.array([box.x, box.y, box.z])
    counts = np.maximum(np.ceil(SAMPLES * edges / edges.max()).astype(int), 1) + 1
    axes = [np.linspace(-0.5 * edge, 0.5 * edge, count) for edge, count in zip(edges, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(grid[(np.abs(np.abs(grid) - 0.5 * edges) < 1e-12).any(axis=1)])


def _cylinder_points(cylinder: Cylinder) -> FloatArray:
    """Rims, lines along the side, and rings on the two caps."""
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


def rotate(orientations: FloatArray, points: FloatArray) -> FloatArray:
    """Points (M, 3) turned by each orientation (N, 4) (x, y, z, w); shape (N, M, 3)."""
    axis, w = orientations[:, None, :3], orientations[:, None, 3:]
    twice = 2.0 * np.cross(axis, points[None])
    return np.asarray(points[None] + w * twice + np.cross(axis, twice))


def clearances(
    surface: Surface, shape: Shape, positions: FloatArray, orientations: FloatArray, reach: float = 0.1
) -> FloatArray:
    """Signed distance (N,) [m] from the surface of bodies at ``positions`` (N, 3) and ``orientations`` (N, 4) to the
    ground: negative = they overlap by so much. Beyond ``reach`` [m] from the skin's points it is cut off there."""
    sample = skin(shape)
    points = positions[:, None] + rotate(orientations, sample.points)
    count = len(sample.points)
    if count == 1:
        return np.asarray(nearest(surface, points[:, 0], sample.radius + reach).distance - sample.radius)
    chosen = _lowest_points(surface, points)
    distance = np.full(points.shape[:2], np.inf)
    distance[chosen] = nearest(surface, points[chosen], sample.radius + reach).distance
    return np.asarray(distance.min(axis=1) - sample.radius)


def _lowest_points(surface: Surface, points: FloatArray) -> NDArray[np.bool_]:
    """Which points (N, M, 3) may be the nearest to the ground of their body's, (N, M).

    Over ground no steeper than s, a distance is between the vertical gap and that times 1 / sqrt(1 + s^2).
    """
    gap = points[..., 2] - surface.below(points.reshape(-1, 3)).reshape(points.shape[:2])
    cosine = 1.0 / math.sqrt(1.0 + surface.steepest**2)
    least, most = np.where(gap > 0.0, gap * cosine, gap), np.where(gap > 0.0, gap, gap * cosine)
    unknown = np.isnan(gap)
    most[unknown], least[unknown] = np.inf, -np.inf  # beside the ground; it may still be near
    return np.asarray(least <= most.min(axis=1, keepdims=True))
