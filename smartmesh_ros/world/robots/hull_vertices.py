"""Hulls of fewer vertices."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.terrain.grid import FloatArray

# Distance from the hull of the vertices that are kept, up to which others are left out [m].
MOST_OUTSIDE = 1e-3
# Directions that are tried at once.
TRIED = 64


def fewer_vertices(vertices: FloatArray, count: int) -> FloatArray:
    """Return vertices (k, 3) [m] of a hull (n, 3): those farthest along ``count`` directions, and enough others that
    none is farther than a millimetre outside their hull."""
    if len(vertices) <= count:
        return vertices
    kept, others = _extreme(vertices, _directions(count)), vertices
    while True:
        others = others[CORE.distances_outside(kept, np.ascontiguousarray(others)) > MOST_OUTSIDE]
        if not len(others):
            return kept
        kept = np.concatenate([kept, _extreme(others, _directions(TRIED))])


def _directions(count: int) -> FloatArray:
    """Return unit directions (count, 3), evenly spread (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    aside = np.sqrt(1.0 - z * z)
    return np.column_stack([aside * np.cos(angle), aside * np.sin(angle), z])


def _extreme(vertices: FloatArray, along: FloatArray) -> FloatArray:
    """Return the vertices that are farthest along one of some directions (d, 3), after scaling all to equal extents
    along each axis, so that thin parts keep as many as others."""
    extents = np.ptp(vertices, axis=0)
    evened = vertices / np.where(extents > 0.0, extents, 1.0)
    farthest = [(evened @ part.T).argmax(axis=0) for part in np.array_split(along, -(-len(along) // TRIED))]
    return np.ascontiguousarray(vertices[np.unique(np.concatenate(farthest))])
