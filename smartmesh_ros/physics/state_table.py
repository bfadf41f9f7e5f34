"""States of many bodies as arrays, and what is worked out for all of them at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from smartmesh_ros.compiled import compiled
from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.limits import FARTHEST, FASTEST, FASTEST_SPIN, MASSES, SIZES
from smartmesh_ros.physics.shapes import DIMENSIONS, Form, Shape, SolidKind, shape_of
from smartmesh_ros.physics.state import QUATERNION_SLACK
from smartmesh_ros.terrain.grid import BoolArray, FloatArray


class StateTable(NamedTuple):
    """n bodies: ``names``; position [m], orientation (x, y, z, w), velocity [m/s] and angular velocity
    [rad/s] as columns of ``numbers`` (n, 13); bounding ``radii`` (n,) [m]; ``kinds`` (n,) of `SolidKind` with their
    ``dimensions`` (n, 3) and the ``centres`` (n, 3) of boxes from their centre of mass [m]; ``masses`` (n,) [kg]."""

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
        """Whether two bodies have the same shape and mass."""
        return bool(
            self.kinds[row] == other.kinds[other_row]
            and self.masses[row] == other.masses[other_row]
            and (self.dimensions[row] == other.dimensions[other_row]).all()
            and (self.centres[row] == other.centres[other_row]).all()
        )

    def same_bodies(self, other: StateTable) -> bool:
        """Whether they are the same bodies, wherever they are."""
        return (
            self.names == other.names
            and np.array_equal(self.kinds, other.kinds)
            and np.array_equal(self.dimensions, other.dimensions)
            and np.array_equal(self.centres, other.centres)
            and np.array_equal(self.masses, other.masses)
        )


def require_sound(states: StateTable) -> None:
    """Raises `InputError`, naming the first body, where a state or a shape can be no body's."""
    numbers, kinds = states.numbers, states.kinds
    used = DIMENSIONS[np.minimum(kinds, len(DIMENSIONS) - 1)]
    sizes = np.where(np.arange(3) < used[:, None], states.dimensions, SIZES[0])
    with np.errstate(over="ignore"):
        turned = np.sqrt((numbers[:, 3:7] ** 2).sum(axis=1))
    for reason, sound, wrong in (
        ("non_finite", np.isfinite(numbers).all(axis=1), "a state that is not finite"),
        ("quaternion", np.abs(turned - 1.0) <= QUATERNION_SLACK, "an orientation whose length is not 1"),
        ("geometry", _within(numbers[:, :3], FARTHEST), f"a position farther than {FARTHEST:g} m"),
        ("geometry", _within(numbers[:, 7:10], FASTEST), f"a velocity above {FASTEST:g} m/s"),
        ("geometry", _within(numbers[:, 10:], FASTEST_SPIN), f"an angular velocity above {FASTEST_SPIN:g} rad/s"),
        ("shape", (kinds > SolidKind.NONE) & (kinds < len(DIMENSIONS)), "a shape of no known kind"),
        ("geometry", _between(sizes, SIZES).all(axis=1), f"a shape not within {SIZES[0]:g} to {SIZES[1]:g} m"),
        ("geometry", _within(states.centres, SIZES[1]), f"a shape farther than {SIZES[1]:g} m from its centre of mass"),
        ("geometry", _between(states.radii, SIZES), f"a radius not within {SIZES[0]:g} to {SIZES[1]:g} m"),
        ("geometry", _between(states.masses, MASSES), f"a mass not within {MASSES[0]:g} to {MASSES[1]:g} kg"),
    ):
        if not sound.all():
            raise InputError(reason, f"body {states.names[int(np.argmin(sound))]!r} has {wrong}")


def _within(values: FloatArray, most: float) -> BoolArray:
    return np.asarray((np.abs(values) <= most).all(axis=1))


def _between(values: FloatArray, bounds: tuple[float, float]) -> BoolArray:
    return np.asarray((values >= bounds[0]) & (values <= bounds[1]))


@compiled
def moved_on(numbers: FloatArray, duration: float) -> FloatArray:
    """States (n, 13) after a ``duration`` [s], which may be negative, at their velocities."""
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
def drawn_to(numbers: FloatArray, targets: FloatArray, share: float) -> FloatArray:
    """States (n, 13) a ``share`` (0 to 1) of the way to others."""
    drawn = numbers + share * (targets - numbers)
    for i in range(len(numbers)):
        cosine = 0.0
        for axis in range(3, 7):
            cosine += numbers[i, axis] * targets[i, axis]
        sign = -1.0 if cosine < 0.0 else 1.0  # both quaternions of a rotation are one: take the shorter way
        length = 0.0
        for axis in range(3, 7):
            drawn[i, axis] = (1.0 - share) * numbers[i, axis] + share * sign * targets[i, axis]
            length += drawn[i, axis] ** 2
        for axis in range(3, 7):
            drawn[i, axis] /= math.sqrt(length)
    return drawn


@compiled
def near_any(
    numbers: FloatArray, duration: float, radii: FloatArray, positions: FloatArray, own_radii: FloatArray,
    own: BoolArray, margins: FloatArray,
) -> BoolArray:  # fmt: skip
    """Which bodies (n,) of ``numbers`` (n, 13), moved on by a ``duration`` [s], come within ``margins`` (n,) [m] of the
    ball around any follower at ``positions`` (N, 3) [m] that is this world's ``own`` (N,)."""
    found = np.zeros(len(numbers), np.bool_)
    for i in range(len(numbers)):
        x = numbers[i, 0] + duration * numbers[i, 7]
        y = numbers[i, 1] + duration * numbers[i, 8]
        z = numbers[i, 2] + duration * numbers[i, 9]
        for j in range(len(positions)):
            reach = radii[i] + own_radii[j] + margins[i]
            away = positions[j, 0] - x
            if own[j] and abs(away) < reach:
                square = away * away + (positions[j, 1] - y) ** 2 + (positions[j, 2] - z) ** 2
                if square < reach * reach:
                    found[i] = True
                    break
    return found


@compiled
def may_touch(
    positions: FloatArray, moved: FloatArray, radii: FloatArray, guests: BoolArray, solid: BoolArray, slack: float
) -> BoolArray:
    """Which of the ``guests`` (N,) came within a ``slack`` [m] of the ball around another ``solid`` (N,) follower in
    the last step, from ``positions`` on by ``moved`` (N, 3) [m]."""
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
