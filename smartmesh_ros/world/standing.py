"""Poses of bodies on the ground: the lowest point of a body, turned as it is, touches the ground.

The underside of a body comes from PyBullet: vertical rays from below meet its collision shapes, and those of all links
of a robot. The smallest distance between underside and ground gives the lift. The samples around the smallest distances
are refined until their spacing is far below a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from smartmesh_ros.errors import InputError, as_float
from smartmesh_ros.ground.quaternions import product
from smartmesh_ros.ground.state import BodyState, Quaternion
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.surface_query import GroundSamples
from smartmesh_ros.world.bodies import Body, bounds_of

NO_TERRAIN = "there is no terrain yet; ask again after the first map"
# Returns the ground under points (N, 2) [m].
GroundAt = Callable[[FloatArray], GroundSamples]
Found = TypeVar("Found")
# Work in parts of at most `RAYS` rays, each of which takes up to 0.2 ms on hulls of a thousand vertices.
Parts = Generator[None, None, Found]
RAYS = 64


# Samples of the underside along each side of its bounds; raising it finds smaller feet.
SAMPLES = 40
# Places with the smallest distance that are refined, samples along each side of one, and rounds of refinement, each of
# which divides the spacing by half of `FINER`.
REFINED, FINER, ROUNDS = 6, 9, 4
# The part of the underside that is higher than its lowest point by less than this stands on the ground [m], and is
# aligned with it in so many rounds, because the feet move as the body tilts.
FEET, TURNS = 0.02, 3
# Height at which a body is measured, far from all others [m].
AWAY = 1e5
# Least horizontal extent of the feet, as a share of the body's bounds, for which a plane is fitted to the ground.
LEAST_EXTENT = 0.1


class Stance(NamedTuple):
    """A body on the ground: its ``state``, whose height is `AWAY`, and ``points`` (n, 3) [m] of its
    underside in that state."""

    state: BodyState
    points: FloatArray

    def on(self, ground_at: GroundAt, clearance: float) -> BodyState:
        """Return the state ``clearance`` [m] above the ground as it is now, and moving with it. Raises `InputError`."""
        if not 0.0 <= as_float(clearance) < math.inf:
            raise InputError("geometry", f"clearance is {clearance} m; it must be zero or more")
        x, y, _ = self.state.position
        lifts = ground_at(self.points[:, :2]).z - self.points[:, 2]
        if np.isnan(lifts).all():
            raise _no_ground(x, y)
        height = AWAY + float(np.nanmax(lifts)) + clearance
        under = ground_at(np.array([[x, y]]))
        velocity = under.velocities[0] if not np.isnan(under.z[0]) else np.zeros(3)
        linear = (np.array(self.state.linear) + velocity).tolist()
        return replace(self.state, position=(x, y, height), linear=(linear[0], linear[1], linear[2]))


def stance_of(client: Any, body: Body, state: BodyState, ground_at: GroundAt, *, align: bool) -> Parts[Stance]:
    """Find how a body stands on the ground at the x and y of a ``state``, in parts; returns its stance.

    ``align``: tilt the body with the ground under its feet. The body is left at another place. Raises `InputError` if
    some part of the body is over no ground.
    """
    x, y, _ = state.position
    turned = state
    for _ in range(TURNS if align else 0):
        points, _ = yield from _underside(client, body, turned)
        turned = replace(turned, orientation=product(_tilt(points, (x, y), ground_at), state.orientation))
    points, spacing = yield from _underside(client, body, turned)
    points = yield from _refined(client, body, points, spacing, ground_at)
    return Stance(turned, points)


def finished(parts: Parts[Found]) -> Found:
    """Do all parts of some work at once, and return its result."""
    while True:
        try:
            next(parts)
        except StopIteration as end:
            found: Found = end.value
            return found


def _underside(client: Any, body: Body, state: BodyState) -> Parts[tuple[FloatArray, float]]:
    """Place a body far from the others; return points (n, 3) [m] of its underside, and their spacing [m]."""
    x, y, _ = state.position
    client.resetBasePositionAndOrientation(body.uid, (x, y, AWAY), state.orientation)
    low, high = bounds_of(client, body)
    axes = [np.linspace(low[axis], high[axis], SAMPLES) for axis in (0, 1)]
    xy = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    points = yield from _from_below(client, body, xy)
    if not len(points):
        raise InputError("geometry", f"{body.name!r} has no underside to stand on; give its height instead")
    return points, float(max(high[:2] - low[:2])) / (SAMPLES - 1)


def _from_below(client: Any, body: Body, xy: FloatArray) -> Parts[FloatArray]:
    """Return the points (n, 3) [m] at which vertical rays at ``xy`` (N, 2) [m] meet a body from below."""
    half = 0.5 * AWAY
    starts, ends = (np.column_stack([xy, np.full(len(xy), AWAY + by)]) for by in (-half, half))
    found = []
    for first in range(0, len(xy), RAYS):
        part = slice(first, first + RAYS)
        hits = client.rayTestBatch(starts[part].tolist(), ends[part].tolist())
        found += [hit[3] for hit in hits if hit[0] == body.uid]
        yield
    return np.array(found, np.float64).reshape(-1, 3)


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


def _refined(client: Any, body: Body, points: FloatArray, spacing: float, ground_at: GroundAt) -> Parts[FloatArray]:
    """Return points (m, 3) [m] of the underside (n, 3) [m] of a body, with more of them where the ground is nearest."""
    needed = _heights(ground_at(points[:, :2]), points).z - points[:, 2]
    steps = np.linspace(-1.0, 1.0, FINER)
    around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    best = points[np.argsort(needed)[-REFINED:], :2]
    found = [points]
    for _ in range(ROUNDS):
        finer = yield from _from_below(client, body, (best[:, None] + spacing * around).reshape(-1, 2))
        if not len(finer):
            break
        found.append(finer)
        lifts = ground_at(finer[:, :2]).z - finer[:, 2]
        lifts[np.isnan(lifts)] = -np.inf
        best = finer[np.argsort(lifts)[-REFINED:], :2]
        spacing *= 2.0 / (FINER - 1)
    return np.concatenate(found)


def _heights(under: GroundSamples, points: FloatArray) -> GroundSamples:
    """Return the ground under points (n, 2+) [m]; raises `InputError` if there is none under one of them."""
    missing = np.flatnonzero(np.isnan(under.z))
    if missing.size:
        raise _no_ground(*points[missing[0], :2].tolist())
    return under


def _no_ground(x: float, y: float) -> InputError:
    where = f"there is no ground at ({x:.3f}, {y:.3f}) m under the body, which is over a hole or beside the map"
    return InputError("no_ground", f"{where}; choose another place, or give the body's height")
