"""Planes in the place of patches, and how far they lie from the main mesh where a body can touch either."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.grid_window import Balls, Window
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.terrain.grid import FloatArray


class Planes(NamedTuple):
    """n planes z = height + slope_x x + slope_y y in the frame of their windows, shapes (n,)."""

    height: FloatArray
    slope_x: FloatArray
    slope_y: FloatArray

    def normals(self) -> FloatArray:
        """Unit normals, upward (n, 3)."""
        normals = np.stack([-self.slope_x, -self.slope_y, np.ones_like(self.height)], axis=1)
        normals /= np.sqrt(np.einsum("ij,ij->i", normals, normals))[:, None]
        return normals

    def above(self, points: FloatArray) -> FloatArray:
        """How far points (n, 3) lie above the planes, vertically (n,) [m]."""
        above: FloatArray = points[:, 2] - self.height - self.slope_x * points[:, 0] - self.slope_y * points[:, 1]
        return above


def fitted_planes(samples: FloatArray, spacing: FloatArray) -> Planes:
    """Planes through 3 x 3 samples (n, 9) [m] that are ``spacing`` (n,) [m] apart, by weighted least squares.

    Linear in the samples: velocities give the velocity of the plane.
    """
    fit = samples @ patch_template(1).fit
    return Planes(fit[:, 0], fit[:, 2] / spacing, fit[:, 1] / spacing)


def near_deviation(heights: FloatArray, window: Window, planes: Planes, balls: Balls) -> FloatArray:
    """How far each plane lies, vertically, from the mesh where a ball can touch either (n,) [m], at most.

    ``heights`` (n, S, S) [m] is one instant of the window. All that the balls can touch must lie in it. Infinite where
    a hole is near, or where the plane can be touched beyond the window.

    Plane and facet differ by a linear function, so they differ most at a corner: it is enough to take the corners of
    all facets that are near. A point of a facet is no further up than its highest corner and no nearer to the foot of
    the perpendicular from the ball's middle than that corner less the facet's length, so the facet's highest corner is
    near if the facet is; and where the facet is below the plane, the ball reaches no further than on the plane itself.
    """
    place = window.places()
    steepness = np.sqrt(1.0 + planes.slope_x**2 + planes.slope_y**2)
    cos = 1.0 / steepness
    distance = planes.above(balls.centres) * cos
    foot_x = balls.centres[:, 0] + distance * planes.slope_x * cos
    foot_y = balls.centres[:, 1] + distance * planes.slope_y * cos
    u, v = place - foot_x[:, None], place - foot_y[:, None]
    climb_x, climb_y = planes.slope_x[:, None] * u, planes.slope_y[:, None] * v
    climb = climb_x[:, None, :] + climb_y[:, :, None]
    base = planes.height + planes.slope_x * foot_x + planes.slope_y * foot_y
    deviation = heights - base[:, None, None] - climb
    size = np.abs(deviation)
    largest = np.nan_to_num(np.where(np.isnan(size), 0.0, size).max(axis=(1, 2)))
    climb *= climb
    climb += (u * u)[:, None, :]
    climb += (v * v)[:, :, None]
    along = np.sqrt(climb)
    sine = np.sqrt(np.maximum(1.0 - cos * cos, 0.0))
    slack = np.sqrt(2.0) * window.resolution * steepness + balls.lateral + largest * sine
    along -= slack[:, None, None]
    np.maximum(along, 0.0, out=along)
    along *= along
    down = distance[:, None, None] - np.maximum(np.where(np.isnan(deviation), 0.0, deviation), 0.0) * cos[:, None, None]
    np.maximum(down, 0.0, out=down)
    along += down * down
    near = along <= (balls.radii**2)[:, None, None]
    bound: FloatArray = np.where(near, np.where(np.isnan(size), np.inf, size), 0.0).max(axis=(1, 2))
    disc = np.sqrt(np.maximum(balls.radii**2 - np.maximum(distance, 0.0) ** 2, 0.0)) + balls.lateral
    beyond = np.maximum(np.abs(foot_x), np.abs(foot_y)) + disc > window.rings * window.resolution
    bound[beyond] = np.inf
    return bound
