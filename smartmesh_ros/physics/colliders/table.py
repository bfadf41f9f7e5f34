"""Table of the colliders that PyBullet moves with the ground, a record for each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.terrain.grid import BoolArray, IntArray

# ``extent`` [m]: half edge of a box, infinite for a half space. ``depth`` [m]: depth of a box's base below its top,
# zero for a half space. ``rows``, ``columns``, ``spacing`` [m]: of a field. ``first``: index of a field's first height
# among those of all fields. ``there``: 1 = placed under a body, 0 = parked, or to be placed anew. ``turned``: 1 = a
# field is rotated by 180 degrees from its usual yaw. ``x``, ``y``, ``z`` [m]: base at ``time`` [s]; ``yaw`` [rad]: of
# the collider's grid; ``tilt_*`` [rad]: tilt since the collider was placed; ``v*`` [m/s], ``w*`` [rad/s]: velocity and
# angular velocity. ``n*``: upward normal of a box's top.
COLLIDER = np.dtype(
    (
        np.record,
        [
            *((name, np.int64) for name in ("rows", "columns", "first", "there", "turned")),
            *(
                (name, np.float64)
                for name in ("extent", "depth", "spacing", "x", "y", "z", "yaw", "tilt_x", "tilt_y", "time")
            ),
            *((name, np.float64) for name in ("vx", "vy", "vz", "wx", "wy", "wz", "nx", "ny", "nz")),
        ],
    )
)

VELOCITIES = ("vx", "vy", "vz", "wx", "wy", "wz")

# Changes of a collider to pass to PyBullet, as bits; MISFIT: the collider does not fit its support.
NOTHING, VELOCITY, POSE, SAMPLES, MISFIT = 0, 1, 2, 4, 8


@dataclass(frozen=True, kw_only=True)
class ColliderConfig:
    """Tolerances and sizes of colliders.

    ``same_height`` [m]: heights that differ by less count as equal. ``same_velocity`` [m/s, rad/s]: a collider keeps
    its velocity while the ground's differs by less; at 60 Hz this is an error of 30 um per update. ``elsewhere``: a
    field whose base is displaced by more than this share of its spacing lies on other samples. ``sunk`` [m]: contacts
    are dropped if any sample sank by more than this relative to the field's base, because PyBullet keeps the contacts
    of a replaced field and would hold a body up where the ground sank. ``hole`` [m]: depth of holes below a field's
    base. ``slope``: slope that a field's bounds allow, from its middle to its edges. ``room``: smallest ratio of a
    box's half edge to its body's need. ``keep`` [s]: a collider that its follower does not use stays with it for this
    time, because bodies that roll alternate between kinds. ``spare``: parked colliders in the pool, as a share of those
    in use; more wake bodies faster, and each costs up to 2.4 us in every step.
    """

    same_height: float = 1e-6
    same_velocity: float = 2e-3
    elsewhere: float = 0.01
    sunk: float = 5e-4
    hole: float = 100.0
    slope: float = 2.0
    room: float = 2.0
    keep: float = 1.0
    spare: float = 0.05


COLLIDERS = ColliderConfig()


class Limits(NamedTuple):
    """`ColliderConfig` and limits from the patch settings, for compiled functions: ``off`` [m]: largest error of a
    collider's surface; ``carry``: move colliders with the ground's velocity."""

    off: float
    carry: bool
    same_height: float
    same_velocity: float
    elsewhere: float
    sunk: float
    hole: float


@compiled
def moves_nowhere(supports: Any, slots: IntArray) -> BoolArray:
    """Return which of the supports (S,) in ``slots`` (n,) are on ground without a velocity (n,)."""
    still = np.empty(len(slots), np.bool_)
    for k in range(len(slots)):
        support = supports[slots[k]]
        slides = support.slide_x != 0.0 or support.slide_y != 0.0 or support.rise != 0.0
        still[k] = not (slides or support.turn_x != 0.0 or support.turn_y != 0.0 or support.turn_z != 0.0)
    return still


@compiled
def advance(collider, time):
    """Update a record to the collider's pose in PyBullet at ``time`` [s]."""
    elapsed = time - collider.time
    if elapsed < 0.0:  # the clock was set back
        collider.there = 0
        elapsed = 0.0
    collider.x += collider.vx * elapsed
    collider.y += collider.vy * elapsed
    collider.z += collider.vz * elapsed
    tilt_x, tilt_y = collider.tilt_x, collider.tilt_y
    collider.tilt_x += (collider.wx - collider.wz * tilt_y) * elapsed
    collider.tilt_y += (collider.wy + collider.wz * tilt_x) * elapsed
    collider.yaw += collider.wz * elapsed
    nx, ny, nz = collider.nx, collider.ny, collider.nz
    nx, ny, nz = (
        nx + (collider.wy * nz - collider.wz * ny) * elapsed,
        ny + (collider.wz * nx - collider.wx * nz) * elapsed,
        nz + (collider.wx * ny - collider.wy * nx) * elapsed,
    )
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        collider.nx, collider.ny, collider.nz = nx / length, ny / length, nz / length
    collider.time = time


@compiled
def base_velocity(collider, support):
    """Velocity of a collider's base in rigid motion with the ground at the support's foot [m/s]."""
    x, y, z = collider.x - support.foot_x, collider.y - support.foot_y, collider.z - support.foot_z
    wx, wy, wz = support.turn_x, support.turn_y, support.turn_z
    return support.slide_x + wy * z - wz * y, support.slide_y + wz * x - wx * z, support.rise + wx * y - wy * x


@compiled
def push(collider, support, limits, stopped, velocity):
    """Write a collider's velocity to ``velocity`` (6,) [m/s, rad/s]; returns True if PyBullet needs it. ``stopped``:
    True if the collider was just placed, which stops it."""
    vx = vy = vz = wx = wy = wz = 0.0
    if limits.carry:
        vx, vy, vz = base_velocity(collider, support)
        wx, wy, wz = support.turn_x, support.turn_y, support.turn_z
    if stopped:
        collider.vx = collider.vy = collider.vz = collider.wx = collider.wy = collider.wz = 0.0
    same = limits.same_velocity
    differs = (
        abs(vx - collider.vx) > same or abs(vy - collider.vy) > same or abs(vz - collider.vz) > same
        or abs(wx - collider.wx) > same or abs(wy - collider.wy) > same or abs(wz - collider.wz) > same
    )  # fmt: skip
    rests = vx == 0.0 and vy == 0.0 and vz == 0.0 and wx == 0.0 and wy == 0.0 and wz == 0.0
    moved = not (
        collider.vx == 0.0 and collider.vy == 0.0 and collider.vz == 0.0
        and collider.wx == 0.0 and collider.wy == 0.0 and collider.wz == 0.0
    )  # fmt: skip
    if not (differs or (rests and moved)):  # zero velocity is always passed, so that no collider creeps
        return False
    collider.vx, collider.vy, collider.vz = vx, vy, vz
    collider.wx, collider.wy, collider.wz = wx, wy, wz
    velocity[0], velocity[1], velocity[2] = vx, vy, vz
    velocity[3], velocity[4], velocity[5] = wx, wy, wz
    return True
