"""What accuracy means here: the figures of a run, each defined once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray

BoolArray = NDArray[np.bool_]

GRAVITY = 9.81  # [m/s^2]
# A body is held up by something where its acceleration differs from gravity's by more than this share of it.
HELD_UP = 0.1


@dataclass(frozen=True)
class Penetration:
    """How well bodies stay on the surface.

    ``p50``, ``p99``, ``most``: how deep they are in the ground [m], over all samples of all bodies that are not lost.
    ``hover`` [m]: 99th percentile of the gap below bodies that something holds up. ``lost``: bodies whose centre was
    below the ground at any sample. ``bodies``: how many there were.
    """

    p50: float
    p99: float
    most: float
    hover: float
    lost: int
    bodies: int


def penetration(clearance: FloatArray, below: BoolArray, held: BoolArray) -> Penetration:
    """Figures of T samples of N bodies: ``clearance`` (T, N) [m], NaN = not on the map; whether their centre is
    ``below`` the ground, and whether something holds them up, (T, N)."""
    gone = np.logical_or.accumulate(below, axis=0)
    valid = np.isfinite(clearance) & ~gone
    depth = np.maximum(-clearance[valid], 0.0)
    gaps = clearance[valid & held]
    p50, p99, most = np.percentile(depth, (50, 99, 100)).tolist() if depth.size else (np.nan,) * 3
    hover = float(np.maximum(np.percentile(gaps, 99), 0.0)) if gaps.size else 0.0
    return Penetration(p50, p99, most, hover, int(gone[-1].sum()) if len(gone) else 0, clearance.shape[1])


def held_up(before: FloatArray, after: FloatArray, dt: float, gravity: float = GRAVITY) -> BoolArray:
    """Which bodies something holds up, from their velocities (N, 3) [m/s] before and after one step of ``dt`` [s]."""
    felt = (after - before) / dt
    felt[:, 2] += gravity
    return np.asarray(np.linalg.norm(felt, axis=1) > HELD_UP * gravity)


def deviation(positions: FloatArray, reference: FloatArray) -> FloatArray:
    """Distance [m] from a reference run, (T, N, 3) each; shape (T, N)."""
    return np.asarray(np.linalg.norm(positions - reference, axis=-1))


def energies(
    mass: float, inertia: FloatArray, positions: FloatArray, linear: FloatArray, angular: FloatArray
) -> FloatArray:
    """Mechanical energy [J] of bodies: ``positions``, ``linear``, ``angular`` (..., 3), ``inertia`` (3,) [kg m^2] in a
    frame in which it is diagonal and that ``angular`` is given in; a sphere's holds in every frame. Shape (...)."""
    kinetic: FloatArray = mass * (linear**2).sum(axis=-1) + (inertia * angular**2).sum(axis=-1)
    total: FloatArray = 0.5 * kinetic + mass * GRAVITY * positions[..., 2]
    return total


def angles_between(normals: FloatArray, true_normals: FloatArray) -> FloatArray:
    """Angle [deg] between unit vectors (N, 3); shape (N,). Accurate for small ones."""
    sine = np.linalg.norm(np.cross(normals, true_normals), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", normals, true_normals))), np.float64)
