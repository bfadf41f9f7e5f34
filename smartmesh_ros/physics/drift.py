"""How heightfields that move on by themselves part from the ground."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.physics.fields import Fields
from smartmesh_ros.terrain.grid import FloatArray


def slopes_of(turns: FloatArray, yaw: float) -> FloatArray:
    """What turns (n, 3) [rad], or turning [rad/s], are as slopes per row and per column of the grid (n, 2)."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    slopes = np.empty((len(turns), 2))
    slopes[:, 0] = cos * turns[:, 0] + sin * turns[:, 1]
    slopes[:, 1] = sin * turns[:, 0] - cos * turns[:, 1]
    return slopes


def distance_from_ground(
    fields: Fields, heights: FloatArray, old: FloatArray, above: FloatArray, slopes: FloatArray
) -> FloatArray:
    """How far colliders with ``old`` heights (m, K) [m] over their bases are from ground with such ``heights`` (m, K)
    [m] over where their bases should be, at their farthest sample (m,) [m].

    ``above`` (m,): of the bases over that [m]; ``slopes`` (m, 2): what the colliders turned by since they were placed,
    per row and per column. NaN where heights are unknown.
    """
    spacing, layout = fields.spacing, fields.layout
    off = old - heights
    off += above[:, None]
    if slopes.any():
        slopes = slopes * spacing[:, None]
        off += slopes[:, :1] * fields.spread(layout.rows)
        off += slopes[:, 1:] * fields.spread(layout.columns)
        # What is turned about its base also moves sideways, the more the higher it is.
        if fields.mixed:
            grade = np.einsum("nk,nkc->nc", heights, layout.fit[fields.which, :, 1:])
        else:
            grade = heights @ layout.fit[0, :, 1:]
        grade /= (spacing * spacing)[:, None]
        off += np.einsum("ij,ij->i", slopes, grade)[:, None] * old
    np.abs(off, out=off)
    distance: FloatArray = off.max(axis=1)
    return distance


def speed_astray(fields: Fields, velocities: FloatArray, twist: FloatArray, yaw: float) -> FloatArray:
    """How fast colliders with ``twist`` (m, 6) part from ground of such ``velocities`` (m, K) [m/s] at its fastest
    sample (m,) [m/s]."""
    slopes = slopes_of(twist[:, 3:], yaw) * fields.spacing[:, None]
    astray = velocities - twist[:, 2:3]
    astray -= slopes[:, :1] * fields.spread(fields.layout.rows)
    astray -= slopes[:, 1:] * fields.spread(fields.layout.columns)
    return np.asarray(np.abs(astray).max(axis=1))
