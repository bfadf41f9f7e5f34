"""Energies of bodies, and angles between normals."""

from __future__ import annotations

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.tools.evaluation.measures import GRAVITY


def energies(
    mass: float, inertia: FloatArray, positions: FloatArray, linear: FloatArray, angular: FloatArray
) -> FloatArray:
    """Return the mechanical energies (...) [J] of bodies; ``positions``, ``linear``, ``angular``: (..., 3).

    ``inertia``: principal moments (3,) [kg m^2]. ``angular`` is in the principal frame, or in any frame for spheres.
    """
    kinetic: FloatArray = mass * (linear**2).sum(axis=-1) + (inertia * angular**2).sum(axis=-1)
    total: FloatArray = 0.5 * kinetic + mass * GRAVITY * positions[..., 2]
    return total


def angles_between(normals: FloatArray, true_normals: FloatArray) -> FloatArray:
    """Return the angles (N,) [deg] between unit vectors (N, 3); accurate for small angles."""
    sine = np.linalg.norm(np.cross(normals, true_normals), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", normals, true_normals))), np.float64)
