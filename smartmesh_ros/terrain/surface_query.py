"""Questions to the surface that bodies stand on, at any instant: height, normal, velocity and age of the ground at
points, and rays onto it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from smartmesh_ros.core import CORE
from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.terrain.checked_heights import as_points, checked_time, unmasked
from smartmesh_ros.terrain.grid import MAX_COORDINATE, FloatArray
from smartmesh_ros.terrain.terrain import Terrain


class GroundSamples(NamedTuple):
    """The ground at N points.

    ``z`` (N,) [m], NaN = no ground. Where there is none, the other arrays are NaN too. ``normals`` (N, 3): unit normals
    of the facets, towards the side of the bodies. ``velocities`` (N, 3) [m/s]: of the ground itself, horizontal motion
    included. ``ages`` (N,) [s]: time since the last map of the place, negative before it. ``friction`` (N,):
    coefficients, of the nearest sample of a height map.
    """

    z: FloatArray
    normals: FloatArray
    velocities: FloatArray
    ages: FloatArray
    friction: FloatArray


def checked_points(points: ArrayLike) -> FloatArray:
    """Return points as (N, 3) [m]; points (N, 2) get z = infinity. Raises `InputError`."""
    array = as_points(points, (2, 3))
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
    return GroundSamples(*CORE.ground_samples(terrain.core, np.ascontiguousarray(points_w), checked_time(time)))


class GroundHits(NamedTuple):
    """What N rays meet: ``distances`` (N,) [m], infinity = no ground; ``normals`` (N, 3): unit normals of the facets,
    towards the side of the bodies, NaN = no ground."""

    distances: FloatArray
    normals: FloatArray


class Rays(NamedTuple):
    """N rays: ``origins`` (N, 3) [m], unit ``directions`` (N, 3), and their length ``reach`` [m]."""

    origins: FloatArray
    directions: FloatArray
    reach: float

    def part(self, chosen: slice) -> Rays:
        """Return some of the rays."""
        return Rays(self.origins[chosen], self.directions[chosen], self.reach)


def checked_rays(origins: ArrayLike, directions: ArrayLike, reach: float) -> Rays:
    """Return rays with directions of length one. Raises `InputError`."""
    given = unmasked(origins, "origins"), unmasked(directions, "directions")
    shapes = [array.shape for array in given]
    if len(shapes[0]) != 2 or shapes[0][1] != 3 or shapes[0] != shapes[1]:
        raise InputError("length", f"origins have shape {shapes[0]} and directions {shapes[1]}; both must be (N, 3)")
    if any(array.dtype.kind not in "fiu" for array in given):
        raise InputError("type", "origins or directions are no real numbers; every coordinate must be one")
    starts, ways = (np.array(array, np.float64, order="C") for array in given)
    if not (np.isfinite(starts).all() and np.isfinite(ways).all()):
        raise InputError("non_finite", "origins or directions are not finite; every number must be")
    if np.abs(starts).max(initial=0.0) > MAX_COORDINATE:
        raise InputError("geometry", f"origins are up to {np.abs(starts).max():g} m away; at most {MAX_COORDINATE:g}")
    good = 0.0 < as_float(reach) <= MAX_COORDINATE
    require(good, "range", "the range of the rays", reach, f"above zero, at most {MAX_COORDINATE:g} m")
    sizes = np.abs(ways).max(axis=1, initial=0.0)
    if not (sizes > 0.0).all():
        raise InputError("direction", f"direction {int(sizes.argmin())} has no length; every direction needs one")
    ways /= sizes[:, None]  # lengths of very large numbers would overflow
    return Rays(starts, ways / np.linalg.norm(ways, axis=1, keepdims=True), float(reach))


class RayCaster:
    """Casts rays onto a terrain. Heights of one instant are kept until the ground has moved on."""

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain
        self._core: Any = CORE.RayCaster(terrain.core)

    def __reduce__(self) -> tuple[type[RayCaster], tuple[Terrain]]:
        return type(self), (self._terrain,)

    def cast(self, rays: Rays, time: float) -> GroundHits:
        """Return where rays meet the ground at ``time`` [s], from either side. They pass through holes. Where tiles
        overlap, a ray meets the surface that it reaches first."""
        return GroundHits(*self._core.cast(*rays, checked_time(time)))
