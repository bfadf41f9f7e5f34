"""Definitions of the accuracy figures of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.terrain.grid import FloatArray

BoolArray = NDArray[np.bool_]

GRAVITY = 9.81  # [m/s^2]
# A body is supported if its acceleration differs from free fall by more than this fraction of gravity.
HELD_UP = 0.1


@dataclass(frozen=True)
class Penetration:
    """Penetration figures of a run.

    ``p50``, ``p99``, ``most`` [m]: percentiles and maximum of the penetration depth, over all samples of all bodies
    that are not lost. ``hover`` [m]: 99th percentile of the gap below supported bodies. ``lost``: number of bodies
    whose centre was below the ground at any sample. ``bodies``: number of all bodies.
    """

    p50: float = math.nan
    p99: float = math.nan
    most: float = math.nan
    hover: float = math.nan
    lost: int = 0
    bodies: int = 0


def penetration(clearance: FloatArray, below: BoolArray, held: BoolArray) -> Penetration:
    """Return the figures of T samples of N bodies, all arguments (T, N).

    ``clearance`` [m]: NaN = not on the map. ``below``: the body's centre is below the ground. ``held``: the body is
    supported.
    """
    gone = np.logical_or.accumulate(below, axis=0)
    valid = np.isfinite(clearance) & ~gone
    depth = np.maximum(-clearance[valid], 0.0)
    gaps = clearance[valid & held]
    p50, p99, most = np.percentile(depth, (50, 99, 100)).tolist() if depth.size else (np.nan,) * 3
    hover = float(np.maximum(np.percentile(gaps, 99), 0.0)) if gaps.size else 0.0
    return Penetration(p50, p99, most, hover, int(gone[-1].sum()) if len(gone) else 0, clearance.shape[1])


def held_up(
    before: FloatArray, after: FloatArray, dt: float, gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY)
) -> BoolArray:
    """Return True (N,) for supported bodies, by velocities (N, 3) [m/s] before and after a step of ``dt`` [s]."""
    felt = np.linalg.norm((after - before) / dt - gravity, axis=1)
    return np.asarray(felt > HELD_UP * math.hypot(*gravity))
