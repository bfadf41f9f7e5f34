"""Intersections of a click's ray with bodies and the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.tools.view.ground import Ground
from smartmesh_ros.tools.view.scene import radius_of
from smartmesh_ros.tools.view.sight import Sight

# Length of a ray [m], and number of points on it that are compared with the ground; their spacing grows linearly.
MAX_DISTANCE, RAY_POINTS = 500.0, 4000
# Distance beside a body at which a click still hits it [m]. Higher values make small bodies easier to hit.
CLICK_MARGIN = 0.05


def body_hit(origin: NDArray[np.float64], direction: NDArray[np.float64], sight: Sight) -> str | None:
    """Return the nearest body whose bounding sphere a ray (unit ``direction``) hits, or None."""
    best, nearest = None, np.inf
    for name, pose in sight.poses.items():
        offset = np.asarray(pose.position) - origin
        along = float(offset @ direction)
        beside = float(np.linalg.norm(offset - along * direction))
        if 0.0 < along < nearest and beside <= radius_of(sight, name) + CLICK_MARGIN:
            best, nearest = name, along
    return best


def ground_hit(
    origin: NDArray[np.float64], direction: NDArray[np.float64], ground: Ground
) -> NDArray[np.float64] | None:
    """Return the point (3,) [m] at which a ray first hits the ground, or None."""
    along = MAX_DISTANCE * np.linspace(0.0, 1.0, RAY_POINTS) ** 2
    points = origin + along[:, None] * direction
    heights = ground.heights(points[:, :2])
    below = points[:, 2] <= heights
    entered = np.flatnonzero(below[1:] & ~below[:-1])
    if not entered.size:
        return None
    # Interpolate linearly between the last point above the ground and the first one below.
    first, second = entered[0], entered[0] + 1
    if np.isnan(heights[first]):
        return np.asarray([*points[second, :2], heights[second]])
    above, under = points[first, 2] - heights[first], heights[second] - points[second, 2]
    return np.asarray(points[first] + above / max(above + under, 1e-12) * (points[second] - points[first]))
