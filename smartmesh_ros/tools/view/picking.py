"""Intersections of a click's ray with bodies and the ground."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.sight import Sight

# Length of a ray [m].
MAX_DISTANCE = 500.0
# Distance beside a body at which a click still hits it [m]. Higher values make small bodies easier to hit.
CLICK_MARGIN = 0.05


def body_hit(origin: FloatArray, direction: FloatArray, sight: Sight) -> str | None:
    """Return the nearest body whose bounding sphere a ray (unit ``direction``) hits, or None."""
    positions, radii = sight.bodies
    along = (positions - origin) @ direction
    beside = np.linalg.norm(positions - origin - along[:, None] * direction, axis=1)
    hit = np.flatnonzero((along > 0.0) & (beside <= radii + CLICK_MARGIN))
    return list(sight.poses)[hit[along[hit].argmin()]] if hit.size else None


def ground_hit(origin: FloatArray, direction: FloatArray, ground: Ground) -> FloatArray | None:
    """Return the point (3,) [m] at which a ray (unit ``direction``) first hits the ground, or None."""
    distance = ground.distances(origin[None], direction[None], MAX_DISTANCE)[0]
    return np.asarray(origin + distance * direction) if np.isfinite(distance) else None
