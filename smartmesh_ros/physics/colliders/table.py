"""Colliders that PyBullet moves on with the ground: one table, a record for each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from smartmesh_ros.compiled import compiled

# ``extent``: half of a box's edges [m], infinite for a half space. ``depth``: how far below its top a box's base is
# [m], zero for a half space. ``rows``, ``columns``, ``spacing`` [m]: of a field. ``first``: where its
# heights start among those of all fields. ``there``: whether PyBullet has it under a body, and not far away.
# ``turned``: whether a field stands half a turn from where it usually does. ``x``, ``y``, ``z`` [m]: its base at
# ``time`` [s]; ``yaw`` [rad]: of the grid it lies along; ``tilt_*`` [rad]: how much it leaned over
# since it was placed; ``v*``
# [m/s], ``w*`` [rad/s]: its velocity. ``n*``: upward normal of a box's top.
COLLIDER = np.dtype(
    [
        *((name, np.int64) for name in ("rows", "columns", "first", "there", "turned")),
        *(
            (name, np.float64)
            for name in ("extent", "depth", "spacing", "x", "y", "z", "yaw", "tilt_x", "tilt_y", "time")
        ),
        *((name, np.float64) for name in ("vx", "vy", "vz", "wx", "wy", "wz", "nx", "ny", "nz")),
    ]
)


# What PyBullet has to be told about a collider, as bits; MISFIT: it cannot be what the support asks for.
NOTHING, VELOCITY, POSE, SAMPLES, MISFIT = 0, 1, 2, 4, 8


@dataclass(frozen=True, kw_only=True)
class ColliderConfig:
    """How colliders are kept where the ground is.

    ``same_height`` [m]: heights that differ by less are the same. ``same_velocity`` [m/s, rad/s]: a collider keeps its
    velocity while the ground's differs by less; in an update at 60 Hz that is 30 um. ``elsewhere``: a field whose base
    is further aside than this share of its spacing lies on other samples. ``sunk`` [m]: PyBullet keeps the contacts of
    a field that is replaced, and a body stays up where the ground sank away under it; they are dropped when any sample
    sank by more than this, seen from the field's base. ``hole`` [m]: how far below
    a field's base its holes are. ``slope``: of a field's bounds, from its middle to its edges. ``room``: half of a
    box's edges over what its body needs, at least.
    """

    same_height: float = 1e-6
    same_velocity: float = 2e-3
    elsewhere: float = 0.01
    sunk: float = 5e-4
    hole: float = 100.0
    slope: float = 2.0
    room: float = 2.0


COLLIDERS = ColliderConfig()


class Limits(NamedTuple):
    """`ColliderConfig` and what depends on the settings of patches, for compiled functions: ``off`` [m]: how far a
    collider may lie from where it should be; ``carry``: whether it carries the ground's velocity."""

    off: float
    carry: bool
    same_height: float
    same_velocity: float
    elsewhere: float
    sunk: float
    hole: float


def at_rest(supports: Any) -> list[bool]:
    """Return True for each of the supports whose ground has no velocity."""
    moving = [supports[name] != 0.0 for name in ("rise", "slide_x", "slide_y", "turn_x", "turn_y", "turn_z")]
    still: list[bool] = (~np.logical_or.reduce(moving)).tolist()
    return still


@compiled
def advance(collider, time):
    """Notes how far PyBullet has moved a collider by ``time`` [s]."""
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
    """Velocity of a collider's base that is rigid with the ground at the support's foot [m/s]."""
    x, y, z = collider.x - support.foot_x, collider.y - support.foot_y, collider.z - support.foot_z
    wx, wy, wz = support.turn_x, support.turn_y, support.turn_z
    return support.slide_x + wy * z - wz * y, support.slide_y + wz * x - wx * z, support.rise + wx * y - wy * x


@compiled
def push(collider, support, limits, stopped, velocity):
    """Writes the velocity that a collider is to have into ``velocity`` (6,) [m/s, rad/s]; whether PyBullet has to be
    told. ``stopped``: it was placed, which stops it."""
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
    if not (differs or (rests and moved)):  # what came to rest is always told so
        return False
    collider.vx, collider.vy, collider.vz = vx, vy, vz
    collider.wx, collider.wy, collider.wz = wx, wy, wz
    velocity[0], velocity[1], velocity[2] = vx, vy, vz
    velocity[3], velocity[4], velocity[5] = wx, wy, wz
    return True
