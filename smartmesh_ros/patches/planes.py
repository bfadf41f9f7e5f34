"""Planes in the place of patches, and how far they lie from the main mesh where a body can touch either."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.patches.grid_window import Balls, Window
from smartmesh_ros.patches.template import patch_template
from smartmesh_ros.terrain.grid import FloatArray, IntArray


class Planes(NamedTuple):
    """n planes z = height + slope_x x + slope_y y in the frame of their windows, shapes (n,)."""

    height: FloatArray
    slope_x: FloatArray
    slope_y: FloatArray

    def of(self, rows: IntArray | slice) -> Planes:
        """Those in ``rows``."""
        return Planes(self.height[rows], self.slope_x[rows], self.slope_y[rows])

    def steepness(self) -> FloatArray:
        """Length along each plane per horizontal length uphill (n,)."""
        return np.sqrt(1.0 + self.slope_x * self.slope_x + self.slope_y * self.slope_y)

    def normals(self) -> FloatArray:
        """Unit normals, upward (n, 3)."""
        normals = np.empty((len(self.height), 3))
        normals[:, 0], normals[:, 1], normals[:, 2] = -self.slope_x, -self.slope_y, 1.0
        normals /= self.steepness()[:, None]
        return normals

    def above(self, points: FloatArray) -> FloatArray:
        """How far points (n, 3) lie above the planes, vertically (n,) [m]."""
        above: FloatArray = points[:, 2] - self.height - self.slope_x * points[:, 0] - self.slope_y * points[:, 1]
        return above


def facet_under(u: FloatArray, v: FloatArray) -> IntArray:
    """Which of the eight facets of 3 x 3 samples lies under points ``u`` columns and ``v`` rows from the middle (n,):
    4 if it is above its cell's diagonal, and 2 and 1 if its cell is that of the later row and column. Points beyond
    the samples get the nearest cell's."""
    column, row = u >= 0.0, v >= 0.0
    return np.asarray(4 * (v - row > u - column) + 2 * row + column)


def planes_through(samples: FloatArray, which: IntArray, spacing: ArrayLike, *, holes: bool) -> FloatArray:
    """Coefficients (..., n, 3) - height at the middle, slopes along x and y - of planes through 3 x 3 ``samples``
    (..., n, 9) [m] that are ``spacing`` (n,) [m] apart: through the facets ``which`` (n,), as by `facet_under`, or
    `ALL_NINE`. With ``holes``, samples may be NaN.

    Linear in the samples: velocities give the velocity of the plane.
    """
    weights = _WEIGHTS[which]
    planes: FloatArray = np.einsum("...nk,nkc->...nc", np.nan_to_num(samples) if holes else samples, weights)
    planes[..., 1:] /= np.reshape(spacing, (-1, 1))
    if holes:
        planes[np.einsum("...nk,nk->...n", np.isnan(samples), weights.any(axis=2)).astype(bool)] = np.nan
    return planes


def as_planes(coefficients: FloatArray) -> Planes:
    """Planes (t n,) from their coefficients (..., n, 3)."""
    return Planes(*np.ascontiguousarray(coefficients.reshape(-1, 3).T))


def foot_offset(planes: Planes, centres: FloatArray) -> FloatArray:
    """Horizontal offset of points (n, 3) from the feet of their perpendiculars on the planes (n, 2) [m]."""
    share = planes.above(centres) / (1.0 + planes.slope_x * planes.slope_x + planes.slope_y * planes.slope_y)
    offset = np.empty((len(share), 2))
    offset[:, 0], offset[:, 1] = -share * planes.slope_x, -share * planes.slope_y
    return offset


def facet_nearest(
    nine: FloatArray, centres: FloatArray, lean: FloatArray, spacing: ArrayLike, *, holes: bool
) -> IntArray:
    """Which facet (n,) of 3 x 3 samples ``nine`` (n, 9) [m] that are ``spacing`` [m] apart lies nearest to points
    ``centres`` (n, 3) [m] from the middle, that are ``lean`` (n, 2) [m] aside of their feet, as far as known."""
    apart = np.reshape(spacing, (-1, 1))
    foot = (centres[:, :2] - lean) / apart
    which = facet_under(foot[:, 0], foot[:, 1])
    # The foot of the perpendicular on that facet's plane lies nearer to where it will be.
    offset = foot_offset(as_planes(planes_through(nine, which, spacing, holes=holes)), centres)
    foot = (centres[:, :2] - (np.nan_to_num(offset) if holes else offset)) / apart
    return facet_under(foot[:, 0], foot[:, 1])


def _plane_weights() -> FloatArray:
    """Weights (9, 9, 3) of 3 x 3 samples in the planes through each facet and through all: height at the middle, and
    how much higher a column and a row further on."""
    weights = np.zeros((9, 3, 3, 3))
    for facet in range(8):
        upper, row, column = facet >> 2, facet >> 1 & 1, facet & 1
        along, across = row + upper, column + 1 - upper  # the row and column where both slopes are seen
        weights[facet, along, column : column + 2, 1] = -1.0, 1.0
        weights[facet, row : row + 2, across, 2] = -1.0, 1.0
        weights[facet, row, column, 0] = 1.0
        # From the cell's first sample on to the middle.
        weights[facet, ..., 0] += (1 - column) * weights[facet, ..., 1] + (1 - row) * weights[facet, ..., 2]
    weights[ALL_NINE] = patch_template(1).fit[:, [0, 2, 1]].reshape(3, 3, 3)
    return weights.reshape(9, 9, 3)


# In the place of a facet's number: a plane fitted to all of 3 x 3 samples, by weighted least squares.
ALL_NINE = 8
_WEIGHTS = _plane_weights()


def rings_touched(window: Window, planes: Planes, balls: Balls) -> IntArray:
    """How many rings around the middle hold every facet that the balls can touch (n,); 0 = none touches.

    ``planes`` run somehow along the ground: the nearer to it, the tighter the answer. Over a cell the mesh rises above
    its plane no further than at the cell's highest corner, and no point of it is nearer, along the plane, to the foot
    of the perpendicular from the ball's middle than the cell's square. A hole counts as ground of any height.
    """
    place = window.places()
    steepness = planes.steepness()
    cos = 1.0 / steepness
    sine = np.sqrt(np.maximum(1.0 - cos * cos, 0.0))
    distance = planes.above(balls.centres) * cos
    foot_x = balls.centres[:, 0] + distance * planes.slope_x * cos
    foot_y = balls.centres[:, 1] + distance * planes.slope_y * cos
    over, highest, furthest = _rise(window, planes)
    shift = furthest * sine
    # No ball reaches further than over ground that is all as high as the highest; the rest is not looked at closely.
    depth = np.maximum(distance - np.maximum(highest, 0.0) * cos, 0.0)
    reach = np.sqrt(np.maximum(balls.radii**2 - depth * depth, 0.0)) + shift + balls.lateral
    most = float((reach + np.maximum(np.abs(foot_x), np.abs(foot_y))).max())
    rings = min(window.rings, int(most / window.resolution) + 1) if most < np.inf else window.rings
    cut = slice(window.rings - rings, window.rings + rings + 1)
    over, place = over[:, cut, cut], place[cut]
    away_x, away_y = _away(foot_x, place, balls.lateral), _away(foot_y, place, balls.lateral)
    top = np.maximum(over[:, :-1], over[:, 1:])
    top = np.maximum(top[:, :, :-1], top[:, :, 1:])
    np.maximum(top, 0.0, out=top)
    top *= -cos[:, None, None]
    top += distance[:, None, None]
    np.maximum(top, 0.0, out=top)
    top *= top
    along = (away_x * away_x)[:, None, :] + (away_y * away_y)[:, :, None]
    if shift.any():
        along = np.maximum(np.sqrt(along) - shift[:, None, None], 0.0)
        along *= along
    along += top
    touched = along <= (balls.radii**2)[:, None, None]
    index = np.arange(-rings, rings)
    ring = np.maximum(-index, index + 1)
    rows = (touched.any(axis=2) * ring).max(axis=1)
    columns = (touched.any(axis=1) * ring).max(axis=1)
    return np.asarray(np.maximum(rows, columns))


def _rise(window: Window, planes: Planes) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How far the ground rises above planes at every sample, at any instant of the window (n, S, S) [m], inf = a hole;
    at the highest (n,); and how far it is from them at the furthest, holes left out (n,)."""
    place = window.places()
    z = window.heights[0] if window.instants == 1 else np.maximum(*window.heights)
    over = z - (planes.slope_y[:, None] * place + planes.height[:, None])[:, :, None]
    over -= (planes.slope_x[:, None] * place)[:, None, :]
    hole = np.isnan(over) if window.holes else None
    if hole is not None:
        over[hole] = 0.0
    flat = over.reshape(len(over), -1)
    highest, lowest = flat.max(axis=1), flat.min(axis=1)
    furthest = np.maximum(highest, -lowest)
    if hole is not None:
        over[hole] = np.inf
        highest[hole.any(axis=(1, 2))] = np.inf
    return over, highest, furthest


def _away(foot: FloatArray, place: FloatArray, lateral: FloatArray) -> FloatArray:
    """Distance of feet (n,) from each cell along one axis, less what a body may slide (n, S - 1) [m]."""
    before = place[:-1] - foot[:, None]
    away: FloatArray = np.maximum(np.maximum(before, (place[:-1] - place[1:]) - before) - lateral[:, None], 0.0)
    return away


def near_deviation(window: Window, planes: Planes, balls: Balls) -> FloatArray:
    """How far each plane lies, vertically, from the mesh where a ball can touch either (t n,) [m], at most.

    Planes and balls are given for each instant of the window, one after the other. All that the balls can touch must
    lie in it. Infinite where a hole is near, or where the plane can be touched beyond the window.

    Plane and facet differ by a linear function, so they differ most at a corner: it is enough to take the corners of
    all facets that are near. A point of a facet is no further up than its highest corner and no nearer to the foot of
    the perpendicular from the ball's middle than that corner less the facet's length, so the facet's highest corner is
    near if the facet is; and where the facet is below the plane, the ball reaches no further than on the plane itself.
    """
    place = window.places()
    steepness = planes.steepness()
    cos = 1.0 / steepness
    distance = planes.above(balls.centres) * cos
    foot_x = balls.centres[:, 0] + distance * planes.slope_x * cos
    foot_y = balls.centres[:, 1] + distance * planes.slope_y * cos
    u, v = place - foot_x[:, None], place - foot_y[:, None]
    climb_x, climb_y = planes.slope_x[:, None] * u, planes.slope_y[:, None] * v
    climb = climb_x[:, None, :] + climb_y[:, :, None]
    base = planes.height + planes.slope_x * foot_x + planes.slope_y * foot_y
    deviation = window.stacked - base[:, None, None] - climb
    size = np.abs(deviation)
    if window.holes:
        hole = np.isnan(size)
        size[hole] = np.inf
        deviation[hole] = 0.0
    largest = np.where(size < np.inf, size, 0.0).max(axis=(1, 2)) if window.holes else size.max(axis=(1, 2))
    climb *= climb
    climb += (u * u)[:, None, :]
    climb += (v * v)[:, :, None]
    along = np.sqrt(climb)
    sine = np.sqrt(np.maximum(1.0 - cos * cos, 0.0))
    slack = np.sqrt(2.0) * window.resolution * steepness + balls.lateral + largest * sine
    along -= slack[:, None, None]
    np.maximum(along, 0.0, out=along)
    along *= along
    np.maximum(deviation, 0.0, out=deviation)
    deviation *= -cos[:, None, None]
    deviation += distance[:, None, None]
    np.maximum(deviation, 0.0, out=deviation)
    deviation *= deviation
    along += deviation
    near = along <= (balls.radii**2)[:, None, None]
    bound: FloatArray = np.where(near, size, 0.0).max(axis=(1, 2))
    disc = np.sqrt(np.maximum(balls.radii**2 - np.maximum(distance, 0.0) ** 2, 0.0)) + balls.lateral
    beyond = np.maximum(np.abs(foot_x), np.abs(foot_y)) + disc > window.rings * window.resolution
    bound[beyond] = np.inf
    return bound
