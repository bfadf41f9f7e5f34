"""The triangles of a small window of a height map, and how far a plane is from those that a ball may touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from smartmesh_ros.patches.grid_window import Balls, Window
from smartmesh_ros.patches.planes import Planes
from smartmesh_ros.terrain.grid import FloatArray


class Facets(NamedTuple):
    """Triangles of n windows of (k + 1) x (k + 1) samples.

    ``slope_x``, ``slope_y``: (n, 2, k, k), first the triangles below each cell's diagonal, then those above it.
    ``corner``: heights of the cells' first samples (n, k, k) [m]. ``places``: x or y of those samples (k,) [m].
    """

    slope_x: FloatArray
    slope_y: FloatArray
    corner: FloatArray
    places: FloatArray
    resolution: float
    holes: bool


def facets_of(window: Window) -> Facets:
    """Facets of windows, their instants one after the other."""
    z = window.stacked
    along, across = np.diff(z, axis=2) / window.resolution, np.diff(z, axis=1) / window.resolution
    # Below the diagonal: (r, c), (r, c + 1), (r + 1, c + 1); above it: (r, c), (r + 1, c + 1), (r + 1, c).
    slope_x = np.stack([along[:, :-1], along[:, 1:]], axis=1)
    slope_y = np.stack([across[:, :, 1:], across[:, :, :-1]], axis=1)
    return Facets(slope_x, slope_y, z[:, :-1, :-1], window.places()[:-1], window.resolution, window.holes)


def facet_deviation(facets: Facets, planes: Planes, balls: Balls) -> FloatArray:
    """How far each plane may lie, vertically, from the facets where a ball can touch either (n,) [m]; infinite where a
    hole is near, or where the plane can be touched beyond the window. What of the facets the balls can touch must lie
    in it.

    A bound, not an estimate: facet and plane differ by a linear function. Where the ball can touch the facet
    (within a disc around the foot of the perpendicular from the ball's middle) or the plane (likewise) it lies between
    its values at the disc's edge, and over the facet between those at the corners.
    """
    x, y, z = (balls.centres[:, axis, None, None, None] for axis in range(3))
    radii, lateral = balls.radii[:, None, None, None], balls.lateral[:, None, None, None]
    flat = Planes(*(values[:, None, None, None] for values in planes))
    places, spacing = facets.places, facets.resolution
    slope_x, slope_y = facets.slope_x, facets.slope_y
    base = facets.corner[:, None] - slope_x * places - slope_y * places[:, None]  # where their planes meet x = y = 0
    tilt_x, tilt_y = slope_x - flat.slope_x, slope_y - flat.slope_y
    offset = base - flat.height
    tilt = np.sqrt(tilt_x * tilt_x + tilt_y * tilt_y)
    lowest, highest = _corner_deviations(offset, tilt_x, tilt_y, facets)
    deviation = np.zeros(len(balls.radii))
    for height, across, along in ((base, slope_x, slope_y), flat):
        steepness = 1.0 / np.sqrt(1.0 + across * across + along * along)
        distance = (z - height - across * x - along * y) * steepness
        disc = np.sqrt(np.maximum(radii * radii - distance * distance, 0.0)) + lateral
        foot_x, foot_y = x + distance * across * steepness, y + distance * along * steepness
        # The disc and the cell may meet: the foot lies within the disc's radius of the cell's square.
        away_x = np.maximum(np.maximum(places - foot_x, foot_x - places - spacing), 0.0)
        away_y = np.maximum(np.maximum(places[:, None] - foot_y, foot_y - places[:, None] - spacing), 0.0)
        near = (away_x * away_x + away_y * away_y <= disc * disc) & (distance <= radii)
        at_foot = offset + tilt_x * foot_x + tilt_y * foot_y
        swing = disc * tilt
        above, below = np.minimum(at_foot + swing, highest), np.maximum(at_foot - swing, lowest)
        worst = np.where(near, np.maximum(above, -below), 0.0)
        if facets.holes:
            worst[np.isnan(worst)] = 0.0
        np.maximum(deviation, worst.max(axis=(1, 2, 3)), out=deviation)
    # The last of the two were the planes themselves.
    aside = np.maximum(np.abs(foot_x), np.abs(foot_y)) + disc
    deviation[(aside > 0.5 * len(places) * spacing)[:, 0, 0, 0] & (distance <= radii)[:, 0, 0, 0]] = np.inf
    if facets.holes:
        holes = np.isnan(slope_x)
        away_x = np.maximum(np.maximum(places - x, x - places - spacing), 0.0)
        away_y = np.maximum(np.maximum(places[:, None] - y, y - places[:, None] - spacing), 0.0)
        near = away_x * away_x + away_y * away_y <= (radii + lateral) ** 2
        deviation[(holes & near).any(axis=(1, 2, 3))] = np.inf
    return deviation


def _corner_deviations(
    offset: FloatArray, tilt_x: FloatArray, tilt_y: FloatArray, facets: Facets
) -> tuple[FloatArray, FloatArray]:
    """The least and the largest deviation at the three corners of each facet (n, 2, k, k)."""
    spacing = facets.resolution
    first = offset + tilt_x * facets.places + tilt_y * facets.places[:, None]
    opposite = first + (tilt_x + tilt_y) * spacing
    third = first.copy()
    third[:, 0] += tilt_x[:, 0] * spacing
    third[:, 1] += tilt_y[:, 1] * spacing
    lowest: FloatArray = np.minimum(np.minimum(first, opposite), third)
    highest: FloatArray = np.maximum(np.maximum(first, opposite), third)
    return lowest, highest
