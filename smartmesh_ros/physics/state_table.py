"""States of many bodies as arrays, and compiled functions on them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.limits import FARTHEST_BODY, FASTEST, FASTEST_SPIN, MASSES, SIZES
from smartmesh_ros.physics.shapes import DIMENSIONS, Form, Shape, SolidKind, shape_of
from smartmesh_ros.physics.state import QUATERNION_SLACK
from smartmesh_ros.terrain.grid import BoolArray, FloatArray


class StateTable(NamedTuple):
    """n bodies: ``names``; ``numbers`` (n, 13) with columns position [m], orientation (x, y, z, w), velocity [m/s] and
    angular velocity [rad/s]; bounding ``radii`` (n,) [m]; ``kinds`` (n,) of `SolidKind` with ``dimensions`` (n, 3) [m];
    ``centres`` (n, 3), the middles of boxes relative to the centre of mass [m]; ``masses`` (n,) [kg]."""

    names: list[str]
    numbers: FloatArray
    radii: FloatArray
    kinds: NDArray[np.uint8]
    dimensions: FloatArray
    centres: FloatArray
    masses: FloatArray

    def shape(self, row: int) -> Shape:
        """The shape of a body."""
        dimensions, centre = self.dimensions[row].tolist(), self.centres[row].tolist()
        return shape_of(Form(SolidKind(int(self.kinds[row])), dimensions, centre))

    def same_body(self, row: int, other: StateTable, other_row: int) -> bool:
        """Return True if two bodies have the same shape and mass."""
        return bool(
            self.kinds[row] == other.kinds[other_row]
            and self.masses[row] == other.masses[other_row]
            and (self.dimensions[row] == other.dimensions[other_row]).all()
            and (self.centres[row] == other.centres[other_row]).all()
        )

    def same_bodies(self, other: StateTable) -> bool:
        """Return True if both tables hold the same bodies, whatever their states."""
        return (
            self.names == other.names
            and np.array_equal(self.kinds, other.kinds)
            and np.array_equal(self.dimensions, other.dimensions)
            and np.array_equal(self.centres, other.centres)
            and np.array_equal(self.masses, other.masses)
        )


# By code of `first_invalid`: reason and words of the refusal.
INVALID = {
    1: ("non_finite", "a state that is not finite"),
    2: ("quaternion", "an orientation whose length is not 1"),
    3: ("geometry", f"a position farther than {FARTHEST_BODY:g} m"),
    4: ("geometry", f"a velocity above {FASTEST:g} m/s"),
    5: ("geometry", f"an angular velocity above {FASTEST_SPIN:g} rad/s"),
    6: ("shape", "a shape of no known kind"),
    7: ("geometry", f"a shape not within {SIZES[0]:g} to {SIZES[1]:g} m"),
    8: ("geometry", f"a shape farther than {SIZES[1]:g} m from its centre of mass"),
    9: ("geometry", f"a radius not within {SIZES[0]:g} to {SIZES[1]:g} m"),
    10: ("geometry", f"a mass not within {MASSES[0]:g} to {MASSES[1]:g} kg"),
}


def require_valid(states: StateTable) -> None:
    """Raise `InputError`, naming the first body, if a state, shape or mass is impossible."""
    row, code = first_invalid(
        states.numbers, states.radii, states.kinds, states.dimensions, states.centres, states.masses
    )
    if code:
        reason, wrong = INVALID[code]
        raise InputError(reason, f"body {states.names[row]!r} has {wrong}")


@compiled
def first_invalid(
    numbers: FloatArray, radii: FloatArray, kinds: NDArray[np.uint8], dimensions: FloatArray, centres: FloatArray,
    masses: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """Return the row of the first impossible body and its code (`INVALID`); zeros if all are valid."""
    for i in range(len(numbers)):
        length = math.sqrt(numbers[i, 3] ** 2 + numbers[i, 4] ** 2 + numbers[i, 5] ** 2 + numbers[i, 6] ** 2)
        if not np.isfinite(numbers[i]).all():
            return i, 1
        if not abs(length - 1.0) <= QUATERNION_SLACK:
            return i, 2
        if np.abs(numbers[i, :3]).max() > FARTHEST_BODY:
            return i, 3
        if np.abs(numbers[i, 7:10]).max() > FASTEST:
            return i, 4
        if np.abs(numbers[i, 10:]).max() > FASTEST_SPIN:
            return i, 5
        if kinds[i] == 0 or kinds[i] >= len(DIMENSIONS):
            return i, 6
        for k in range(DIMENSIONS[kinds[i]]):
            if not SIZES[0] <= dimensions[i, k] <= SIZES[1]:
                return i, 7
        for k in range(3):
            if not abs(centres[i, k]) <= SIZES[1]:
                return i, 8
        if not SIZES[0] <= radii[i] <= SIZES[1]:
            return i, 9
        if not MASSES[0] <= masses[i] <= MASSES[1]:
            return i, 10
    return 0, 0


@compiled
def extrapolated(numbers: FloatArray, duration: float) -> FloatArray:
    """Return states (n, 13) extrapolated by a ``duration`` [s], which may be negative, at constant velocities."""
    moved = numbers.copy()
    for i in range(len(numbers)):
        for axis in range(3):
            moved[i, axis] += duration * numbers[i, 7 + axis]
        wx, wy, wz = numbers[i, 10], numbers[i, 11], numbers[i, 12]
        speed = math.sqrt(wx * wx + wy * wy + wz * wz)
        if speed > 0.0:
            scale, w = math.sin(0.5 * speed * duration) / speed, math.cos(0.5 * speed * duration)
            x, y, z = scale * wx, scale * wy, scale * wz
            qx, qy, qz, qw = numbers[i, 3], numbers[i, 4], numbers[i, 5], numbers[i, 6]
            moved[i, 3] = w * qx + x * qw + y * qz - z * qy
            moved[i, 4] = w * qy + y * qw + z * qx - x * qz
            moved[i, 5] = w * qz + z * qw + x * qy - y * qx
            moved[i, 6] = w * qw - x * qx - y * qy - z * qz
    return moved


@compiled
def blended(numbers: FloatArray, targets: FloatArray, share: float) -> FloatArray:
    """Interpolate from states (n, 13) to ``targets`` by a ``share`` (0 to 1)."""
    drawn = numbers + share * (targets - numbers)
    for i in range(len(numbers)):
        cosine = 0.0
        for axis in range(3, 7):
            cosine += numbers[i, axis] * targets[i, axis]
        sign = -1.0 if cosine < 0.0 else 1.0  # q and -q are the same rotation: take the shorter way
        length = 0.0
        for axis in range(3, 7):
            drawn[i, axis] = (1.0 - share) * numbers[i, axis] + share * sign * targets[i, axis]
            length += drawn[i, axis] ** 2
        for axis in range(3, 7):
            drawn[i, axis] /= math.sqrt(length)
    return drawn


@compiled
def near_any(
    numbers: FloatArray, duration: float, radii: FloatArray, positions: FloatArray, velocities: FloatArray,
    own_radii: FloatArray, own: BoolArray, margins: FloatArray, horizon: float,
) -> BoolArray:  # fmt: skip
    """Return which bodies (n,) come near this world's own bodies.

    The bodies of ``numbers`` (n, 13) are extrapolated by ``duration`` [s]. A body is near if its bounding sphere is
    within its margin (``margins`` (n,) [m]) of the bounding sphere of any ``own`` (N,) body, or can come there within a
    ``horizon`` [s] at their relative speed. ``positions`` [m], ``velocities`` [m/s] (N, 3), ``own_radii`` (N,) [m]: of
    the attached bodies of this world.
    """
    found = np.zeros(len(numbers), np.bool_)
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    fastest = largest = 0.0
    for j in range(len(positions)):
        if own[j] and not math.isnan(positions[j, 0]):  # its position is known
            low_x, high_x = min(low_x, positions[j, 0]), max(high_x, positions[j, 0])
            low_y, high_y = min(low_y, positions[j, 1]), max(high_y, positions[j, 1])
            speed = math.sqrt(velocities[j, 0] ** 2 + velocities[j, 1] ** 2 + velocities[j, 2] ** 2)
            fastest, largest = max(fastest, speed), max(largest, own_radii[j])
    for i in range(len(numbers)):
        x = numbers[i, 0] + duration * numbers[i, 7]
        y = numbers[i, 1] + duration * numbers[i, 8]
        z = numbers[i, 2] + duration * numbers[i, 9]
        speed = math.sqrt(numbers[i, 7] ** 2 + numbers[i, 8] ** 2 + numbers[i, 9] ** 2)
        most = radii[i] + largest + margins[i] + (speed + fastest) * horizon
        if x < low_x - most or x > high_x + most or y < low_y - most or y > high_y + most:
            continue  # outside the bounds of all own bodies
        for j in range(len(positions)):
            away = positions[j, 0] - x
            if own[j] and abs(away) < most:
                distance = math.sqrt(away * away + (positions[j, 1] - y) ** 2 + (positions[j, 2] - z) ** 2)
                square = 0.0
                for axis in range(3):
                    square += (numbers[i, 7 + axis] - velocities[j, axis]) ** 2
                if distance < radii[i] + own_radii[j] + margins[i] + math.sqrt(square) * horizon:
                    found[i] = True
                    break
    return found


@compiled
def may_touch(
    positions: FloatArray, moved: FloatArray, radii: FloatArray, guests: BoolArray, solid: BoolArray, slack: float
) -> BoolArray:
    """Return which of the ``guests`` (N,) came within a ``slack`` [m] of the bounding sphere of another ``solid`` (N,)
    body in the last step, from ``positions`` on by ``moved`` (N, 3) [m]."""
    found = np.zeros(len(positions), np.bool_)
    for i in range(len(positions)):
        if not guests[i]:
            continue
        for j in range(len(positions)):
            if i == j or not solid[j]:
                continue
            square = step = 0.0
            for axis in range(3):
                square += (positions[i, axis] - positions[j, axis]) ** 2
                step += (moved[i, axis] - moved[j, axis]) ** 2
            reach = radii[i] + radii[j] + slack + math.sqrt(step)
            if square < reach * reach:
                found[i] = True
                break
    return found
