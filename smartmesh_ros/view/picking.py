"""What a click on the page meant: a ray meets bodies and the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.view.ground import Ground
from smartmesh_ros.view.scene import radius_of
from smartmesh_ros.view.sight import Sight

# How far along a ray the ground is looked for [m], in so many steps, each longer than the one before.
FARTHEST, STEPS = 500.0, 4000
# Small bodies are hit this far beside them [m].
SLACK = 0.05


def body_hit(origin: NDArray[np.float64], direction: NDArray[np.float64], sight: Sight) -> str | None:
    """The nearest body whose sphere a ray (unit ``direction``) meets; None where there is none."""
    best, nearest = None, np.inf
    for name, pose in sight.poses.items():
        offset = np.asarray(pose.position) - origin
        along = float(offset @ direction)
        beside = float(np.linalg.norm(offset - along * direction))
        if 0.0 < along < nearest and beside <= radius_of(sight, name) + SLACK:
            best, nearest = name, along
    return best


def ground_hit(
    origin: NDArray[np.float64], direction: NDArray[np.float64], ground: Ground
) -> NDArray[np.float64] | None:
    """Where a ray first comes through the ground (3,) [m]; None where it does not."""
    along = FARTHEST * np.linspace(0.0, 1.0, STEPS) ** 2
    points = origin + along[:, None] * direction
    heights = ground.heights(points[:, :2])
    below = points[:, 2] <= heights
    entered = np.flatnonzero(below[1:] & ~below[:-1])
    if not entered.size:
        return None
    # Between the two points the ground is taken to be straight.
    first, second = entered[0], entered[0] + 1
    if np.isnan(heights[first]):
        return np.asarray([*points[second, :2], heights[second]])
    above, under = points[first, 2] - heights[first], heights[second] - points[second, 2]
    return np.asarray(points[first] + above / max(above + under, 1e-12) * (points[second] - points[first]))
