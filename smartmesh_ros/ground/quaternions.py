"""Rotations as unit quaternions (x, y, z, w), in double precision; PyBullet's own helpers work in single precision."""

from __future__ import annotations

import math

import numpy as np

from smartmesh_ros.ground.state import Quaternion, Vector
from smartmesh_ros.terrain.grid import FloatArray

X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
# Angle between two quaternions below which the arc equals a straight line in double precision [rad].
STRAIGHT = 1e-6
# Length of a quaternion's vector part below which it is half of the rotation vector in double precision.
TINY = 1e-12
# Step of rounded quaternions, far above the rounding of matrices, and size of a component that follows from the others:
# below 0.5, which the largest one of each quaternion reaches, and no component of a usual rotation.
STEP, LARGE = 2.0**-45, 0.45


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation ``b`` followed by ``a``."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def about(axis: Vector, angle: float) -> Quaternion:
    """The rotation by an ``angle`` [rad] about a unit vector."""
    (x, y, z), sine = axis, math.sin(0.5 * angle)
    return x * sine, y * sine, z * sine, math.cos(0.5 * angle)


def conjugate(q: Quaternion) -> Quaternion:
    """The inverse rotation."""
    return -q[0], -q[1], -q[2], q[3]


def rounded(q: Quaternion) -> Quaternion:
    """Return a rotation that comes back equal to the bit from whoever keeps it as a matrix, as PyBullet does, if the
    answer is rounded, too. Three components are multiples of `STEP`; the length gives the other, which is positive."""
    free = next(index for index in (3, 0, 1, 2) if abs(q[index]) > LARGE)
    parts = [round(math.copysign(value, value * q[free]) / STEP) * STEP for value in q]
    others = sum(value * value for index, value in enumerate(parts) if index != free)
    parts[free] = math.sqrt(1.0 - others)
    return parts[0], parts[1], parts[2], parts[3]


def rotate(q: Quaternion, v: Vector) -> Vector:
    """Rotate a vector."""
    x, y, z, _ = product(product(q, (*v, 0.0)), conjugate(q))
    return x, y, z


def rotated(orientations: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return vectors (..., 3) rotated by unit quaternions (..., 4), whose leading axes are broadcast."""
    axis, w = orientations[..., :3], orientations[..., 3:]
    twice = 2.0 * np.cross(axis, vectors)
    return np.asarray(vectors + w * twice + np.cross(axis, twice))


def rotation_vector(q: Quaternion) -> Vector:
    """The axis of a rotation by half a turn at most, as long as its angle [rad]."""
    x, y, z, w = q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    length = math.hypot(x, y, z)
    factor = 2.0 * math.atan2(length, w) / length if length > TINY else 2.0
    return factor * x, factor * y, factor * z


def slerp(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    """Interpolate by a ``share`` (0 to 1) along the shorter arc from ``a`` to ``b``."""
    cosine = sum(x * y for x, y in zip(a, b, strict=True))
    sign = -1.0 if cosine < 0.0 else 1.0
    apart = math.hypot(*(x - sign * y for x, y in zip(a, b, strict=True)))
    together = math.hypot(*(x + sign * y for x, y in zip(a, b, strict=True)))
    angle = 2.0 * math.atan2(apart, together)
    if angle < STRAIGHT:
        first, second = 1.0 - share, share
    else:
        first, second = math.sin((1.0 - share) * angle) / math.sin(angle), math.sin(share * angle) / math.sin(angle)
    x, y, z, w = (first * p + sign * second * q for p, q in zip(a, b, strict=True))
    length = math.hypot(x, y, z, w)
    return x / length, y / length, z / length, w / length


def quaternion_of(rotation: FloatArray) -> Quaternion:
    """Return the unit quaternion of a rotation (3, 3), by its largest number (Shepperd, 1978)."""
    r = rotation.tolist()
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [*(1.0 + 2.0 * r[k][k] - trace for k in range(3)), 1.0 + trace]
    most = max(range(4), key=squares.__getitem__)
    size = math.sqrt(squares[most])
    found = [0.0, 0.0, 0.0, 0.0]
    if most == 3:
        found[:3] = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]
    else:
        i, j, k = most, (most + 1) % 3, (most + 2) % 3
        found[j], found[k], found[3] = r[j][i] + r[i][j], r[k][i] + r[i][k], r[k][j] - r[j][k]
    found = [0.5 * value / size for value in found]
    found[most] = 0.5 * size
    x, y, z, w = found
    return x, y, z, w
