"""Poses of bodies on the ground: the lowest point of a body, turned as it is, touches the ground.

The smallest distance between the lower surface of the body, a robot with all its links, and the ground gives the lift.
The samples around the smallest distances are refined until their spacing is far below a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.core.body_shape import BodyShape
from smartmesh_ros.errors import InputError, as_float, require
from smartmesh_ros.ground.quaternions import product
from smartmesh_ros.ground.state import BodyState, Quaternion
from smartmesh_ros.ground.transform import Transform
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.surface_query import GroundSamples

NO_TERRAIN = "there is no terrain yet; ask again after the first map"
# Returns the ground under points (N, 2) [m].
GroundAt = Callable[[FloatArray], GroundSamples]


# Samples of the lower surface along each side of its bounds; raising it finds smaller feet.
SAMPLES = 40
# Places with the smallest distance that are refined, samples along each side of one, and rounds of refinement, each of
# which divides the spacing by half of `FINER`.
REFINED, FINER, ROUNDS = 6, 9, 4
# The part of the lower surface that is higher than its lowest point by less than this stands on the ground [m], and is
# aligned with it in so many rounds, because the feet move as the body tilts.
FEET, TURNS = 0.02, 3
# Least horizontal extent of the feet, as a share of the body's bounds, for which a plane is fitted to the ground.
LEAST_EXTENT = 0.1


class Underside:
    """The lower surface of a body whose links have ``shapes``, and ``poses`` of their centres of mass in the frame of
    the body's centre of mass."""

    def __init__(self, shapes: Sequence[BodyShape], poses: Sequence[Transform]) -> None:
        self._core: Any = CORE.LowerSurface(list(shapes))
        self._poses = poses

    def bounds(self, state: BodyState) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and highest corner (3,) [m] of the box around all parts in a state."""
        low, high = self._core.bounds(self._placed(state))
        return low, high

    def samples(self, state: BodyState) -> tuple[FloatArray, float]:
        """Return points (n, 3) [m] of the surface in a state, among them the lowest of each part, and their spacing
        [m]."""
        low, high = self.bounds(state)
        axes = [np.linspace(low[axis], high[axis], SAMPLES) for axis in (0, 1)]
        xy = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        points = np.concatenate([self.at(state, xy), self.lowest(state, np.array([[0.0, 0.0, 1.0]]))])
        return points, float(max(high[:2] - low[:2])) / (SAMPLES - 1)

    def at(self, state: BodyState, xy: FloatArray) -> FloatArray:
        """Return the points (n, 3) [m] of the surface in a state at some of ``xy`` (N, 2) [m]: where there is one."""
        heights = self._core.heights(self._placed(state), xy)
        there = ~np.isnan(heights)
        return np.column_stack([xy[there], heights[there]])

    def lowest(self, state: BodyState, up: FloatArray) -> FloatArray:
        """Return the lowest points (n * parts, 3) [m] in a state of all parts along unit vectors (n, 3)."""
        found: FloatArray = self._core.lowest(self._placed(state), np.ascontiguousarray(up))
        return found

    def _placed(self, state: BodyState) -> FloatArray:
        frame = Transform.of(state)
        return np.array([[*it.translation, *it.rotation] for it in map(frame.then, self._poses)])


def put_on_ground(
    under: Underside, state: BodyState, ground_at: GroundAt, *, clearance: float, align: bool
) -> BodyState:
    """Return a ``state`` at the height at which the lower surface is ``clearance`` [m] above the ground, with the
    ground's velocity added.

    ``align``: tilt the body with the ground under its feet. Raises `InputError` if some part of the body is over no
    ground.
    """
    require(0.0 <= as_float(clearance) < math.inf, "geometry", "clearance", clearance, "zero or more [m]")
    x, y, _ = state.position
    turned = replace(state, position=(x, y, 0.0))
    for _ in range(TURNS if align else 0):
        points, _ = under.samples(turned)
        turned = replace(turned, orientation=product(_tilt(points, (x, y), ground_at), state.orientation))
    height = _lift(under, turned, ground_at) + clearance
    below = ground_at(np.array([[x, y]]))
    velocity = below.velocities[0] if not np.isnan(below.z[0]) else np.zeros(3)
    linear = (np.array(state.linear) + velocity).tolist()
    return replace(turned, position=(x, y, height), linear=(linear[0], linear[1], linear[2]))


def _lift(under: Underside, state: BodyState, ground_at: GroundAt) -> float:
    """Return how far a body in a state must rise for its lower surface to touch the ground [m]."""
    points, spacing = under.samples(state)
    below = _heights(ground_at(points[:, :2]), points)
    lifts = below.z - points[:, 2]
    corners = under.lowest(state, below.normals[np.argsort(lifts)[-REFINED:]])
    points, lifts = np.concatenate([points, corners]), np.concatenate([lifts, _lifts(ground_at, corners)])
    steps = np.linspace(-1.0, 1.0, FINER)
    around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    lift = float(lifts.max())
    for _ in range(ROUNDS):
        best = points[np.argsort(lifts)[-REFINED:], :2]
        points = under.at(state, (best[:, None] + spacing * around).reshape(-1, 2))
        lifts = _lifts(ground_at, points)
        lift = max(lift, float(lifts.max(initial=-math.inf)))
        spacing *= 2.0 / (FINER - 1)
    return lift


def _lifts(ground_at: GroundAt, points: FloatArray) -> FloatArray:
    """Return how far points (n, 3) [m] are below the ground [m], -infinity where there is none."""
    lifts = ground_at(points[:, :2]).z - points[:, 2]
    return np.where(np.isnan(lifts), -math.inf, lifts)


def _tilt(points: FloatArray, centre: tuple[float, float], ground_at: GroundAt) -> Quaternion:
    """Return the rotation from the vertical to the normal of the ground under the feet of an underside (n, 3) [m]."""
    feet = points[points[:, 2] < points[:, 2].min() + FEET]
    normal = _heights(ground_at(np.array([centre])), np.array([centre])).normals[0]
    offsets = feet[:, :2] - feet[:, :2].mean(axis=0)
    extent = np.sqrt(np.linalg.eigvalsh(offsets.T @ offsets / len(offsets))[0])
    if extent > LEAST_EXTENT * np.ptp(points[:, :2], axis=0).max():
        heights = _heights(ground_at(feet[:, :2]), feet).z
        slope = np.linalg.lstsq(np.column_stack([offsets, np.ones(len(offsets))]), heights, rcond=None)[0]
        normal = np.array([-slope[0], -slope[1], 1.0]) / math.sqrt(1.0 + slope[0] ** 2 + slope[1] ** 2)
    x, y, z = normal.tolist()
    length = math.sqrt(x * x + y * y + (1.0 + z) ** 2)
    return -y / length, x / length, 0.0, (1.0 + z) / length


def _heights(under: GroundSamples, points: FloatArray) -> GroundSamples:
    """Return the ground under points (n, 2+) [m]; raises `InputError` if there is none under one of them."""
    missing = np.flatnonzero(np.isnan(under.z))
    if missing.size:
        x, y = points[missing[0], :2].tolist()
        raise InputError(
            "no_ground",
            f"there is no ground at ({x:.3f}, {y:.3f}) m under the body, which is over a hole or beside the map; "
            "choose another place, or give the body's height",
        )
    return under
