"""Height, normal, velocity and age of the ground at points: the surface that bodies stand on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.checked_heights import unmasked
from smartmesh_ros.terrain.grid import MAX_COORDINATE, FloatArray
from smartmesh_ros.terrain.terrain import Terrain


class GroundSamples(NamedTuple):
    """The ground at N points.

    ``z`` (N,) [m], NaN = no ground. Where there is none, the other arrays are NaN too. ``normals`` (N, 3): unit normals
    of the facets, towards the side of the bodies. ``velocities`` (N, 3) [m/s]: of the ground itself, horizontal motion
    included. ``ages`` (N,) [s]: time since the last map of the place, negative before it.
    """

    z: FloatArray
    normals: FloatArray
    velocities: FloatArray
    ages: FloatArray


def checked_points(points: ArrayLike) -> FloatArray:
    """Return points as (N, 3) [m]; points (N, 2) get z = infinity. Raises `InputError`."""
    array = unmasked(points)
    if array.ndim != 2 or array.shape[1] not in (2, 3) or array.dtype.kind not in "fiu":
        raise InputError(
            "length", f"points have shape {array.shape}; they must be real numbers of shape (N, 2) or (N, 3)"
        )
    whole = np.full((len(array), 3), np.inf)
    whole[:, : array.shape[1]] = array
    if not np.isfinite(whole[:, :2]).all() or np.isnan(whole[:, 2]).any():
        raise InputError("non_finite", "points contain numbers that are not finite; every coordinate must be")
    if np.abs(whole[:, :2]).max(initial=0.0) > MAX_COORDINATE:
        farthest = np.abs(whole[:, :2]).max()
        raise InputError("geometry", f"points are up to {farthest:g} m away; at most {MAX_COORDINATE:g} is possible")
    return whole


def ground_samples(terrain: Terrain, points_w: FloatArray, time: float) -> GroundSamples:
    """Return the ground under points (N, 3) [m] at ``time`` [s].

    The result at a point is the highest ground of the first height map with ground there, and of all meshes. Ground
    above a point does not count, so z = infinity asks for the highest ground. Gaps of up to a cell between height maps
    are ground, as for bodies.
    """
    count = len(points_w)
    found = GroundSamples(*(np.full(shape, np.nan) for shape in (count, (count, 3), (count, 3), count)))
    CORE.ground_samples(terrain.readers, np.ascontiguousarray(points_w), time, *found)
    return found
