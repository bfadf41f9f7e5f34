"""The place at which the soil under a body has the force and the moments of the body's contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.compiled import compiled
from smartmesh_ros.soil.feet import Triple
from smartmesh_ros.soil.law import pressure_at, stiffness_at
from smartmesh_ros.terrain.grid import FloatArray

# A sample under a body, at (``row``, ``column``). Heights [m] without the grid's z: of the body's underside ``low``, of
# the ground ``now`` and as it was never pressed, ``level``. ``area`` [m^2]: covered by the body. ``x``, ``y``: distance
# from the body's middle along columns and rows, in sizes of the body. ``plastic`` [m], ``yielded`` [Pa]: see
# `SoilLayer`. ``modulus``: Bekker's, with the width of the patch. ``exponent``, ``elastic``, ``damping``: of its soil.
SAMPLE = np.dtype(
    (
        np.record,
        [
            ("row", np.int64), ("column", np.int64), ("low", np.float64), ("now", np.float64), ("level", np.float64),
            ("area", np.float64), ("x", np.float64), ("y", np.float64), ("plastic", np.float64),
            ("yielded", np.float64), ("modulus", np.float64), ("exponent", np.float64), ("elastic", np.float64),
            ("damping", np.float64),
        ],
    )
)  # fmt: skip
# Most rounds of the search for the sinkage. Newton's method needs three to six; bisection is the fallback.
ROUNDS = 40
# Most rounds, and halvings of a step, of the search for the lean.
LEAN_ROUNDS, HALVINGS = 4, 2
# Relative errors of the carried force and moments at which the searches end.
LOAD_ERROR, MOMENT_ERROR = 1e-5, 1e-3


@compiled
def pressed_to(sample: Any, lean: Triple) -> float:
    """Return the height [m] to which a record of ``SAMPLE`` is pressed by a ``lean`` (3,): how far the body goes down
    [m], and how much farther at its size along columns and rows [m]."""
    return sample.low - lean[0] - lean[1] * sample.x - lean[2] * sample.y


@compiled
def loaded(sample: Any, lean: Triple, dt: float) -> tuple[float, float, float]:
    """Return the soil's pressure [Pa] on a sample, the total with damping, and the derivative of the total by the
    sinkage [Pa/m]. The total is zero where the body lifts off."""
    height = pressed_to(sample, lean)
    sinkage = sample.level - height
    if sinkage <= 0.0:
        return 0.0, 0.0, 0.0
    pressure = pressure_at(sinkage, sample.plastic, sample.yielded, sample.modulus, sample.exponent, sample.elastic)
    total = pressure + sample.damping * (sample.now - height) / dt
    if total <= 0.0:
        return 0.0, 0.0, 0.0
    stiffness = stiffness_at(sinkage, pressure, sample.plastic, sample.exponent, sample.elastic)
    return pressure, total, stiffness + sample.damping / dt


@compiled
def balance(samples: Any, load: float, lean: Triple, start: float, deepest: float, dt: float) -> float:
    """Return how far the body goes down [m], at most ``deepest``, so that the soil carries a ``load`` [N].

    Newton's method from ``start``, with bisection where it leaves the bracket: the force grows with the depth. The
    other parts of ``lean`` stay.
    """
    trial, low, high = start, start, deepest
    for sample in samples:  # the highest place, at which the body touches nothing
        low = min(low, pressed_to(sample, (0.0, lean[1], lean[2])) - sample.level)
    for _ in range(ROUNDS):
        force, slope = 0.0, 0.0
        for sample in samples:
            if sample.area > 0.0:
                _, total, stiffness = loaded(sample, (trial, lean[1], lean[2]), dt)
                force += sample.area * total
                slope += sample.area * stiffness
        if abs(force - load) <= LOAD_ERROR * load:
            break
        if force < load:
            low = trial
        else:
            high = trial
        if high - low <= 1e-12:
            break
        trial = trial + (load - force) / slope if slope > 0.0 else high
        if not low < trial < high:
            trial = 0.5 * (low + high)
    return trial


@compiled
def residual(
    samples: Any, load: float, moments: FloatArray, lean: FloatArray, dt: float, missing: FloatArray, slopes: FloatArray
) -> float:
    """Write what the soil's force and moments lack (3,) [N], and their derivatives by ``lean`` (3, 3) [N/m]; return the
    largest lack as a share of the ``load``."""
    missing[0], missing[1], missing[2] = load, moments[0], moments[1]
    slopes[:, :] = 0.0
    at = (lean[0], lean[1], lean[2])
    for sample in samples:
        area, x, y = sample.area, sample.x, sample.y
        if area > 0.0:
            _, total, stiffness = loaded(sample, at, dt)
            missing[0] -= area * total
            missing[1] -= area * total * x
            missing[2] -= area * total * y
            slopes[0, 0] += area * stiffness
            slopes[0, 1] += area * stiffness * x
            slopes[0, 2] += area * stiffness * y
            slopes[1, 1] += area * stiffness * x * x
            slopes[1, 2] += area * stiffness * x * y
            slopes[2, 2] += area * stiffness * y * y
    slopes[1, 0], slopes[2, 0], slopes[2, 1] = slopes[0, 1], slopes[0, 2], slopes[1, 2]
    return max(abs(missing[0]), abs(missing[1]), abs(missing[2])) / load


@compiled
def solve_3x3(a: FloatArray, b: FloatArray, x: FloatArray) -> bool:
    """Write the solution of a symmetric positive definite system to ``x`` (3,) by Cramer's rule; return False if the
    matrix is nearly singular."""
    c00, c01 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1], a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c02 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    determinant = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    if not determinant > 1e-9 * a[0, 0] ** 3:
        return False
    c11, c12 = a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0], a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1]
    c22 = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    x[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / determinant
    x[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / determinant
    x[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / determinant
    return True


@compiled
def lean_over(
    samples: Any, load: float, moments: FloatArray, lean: FloatArray, deepest: float, most: float, dt: float
) -> bool:
    """Change ``lean`` until the soil has the ``load`` [N] and the ``moments`` (2,) [N], relative to the body's size, of
    the contacts, by Newton's method with halved steps; return False if that was not reached. The lean of a body stays
    below ``most`` [m]: contacts at its edge may need more than the soil there can give."""
    missing, slopes, step, trial = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty(3)
    worst = residual(samples, load, moments, lean, dt, missing, slopes)
    for _ in range(LEAN_ROUNDS):
        if worst <= MOMENT_ERROR:
            return True
        if not solve_3x3(slopes, missing, step):
            return False
        better = False
        for _ in range(HALVINGS):
            trial[0] = min(lean[0] + step[0], deepest)
            trial[1] = min(max(lean[1] + step[1], -most), most)
            trial[2] = min(max(lean[2] + step[2], -most), most)
            found = residual(samples, load, moments, trial, dt, missing, slopes)
            if found < worst:
                better = True
                break
            step[0], step[1], step[2] = 0.5 * step[0], 0.5 * step[1], 0.5 * step[2]
        if not better:
            return False
        worst = found
        lean[0], lean[1], lean[2] = trial[0], trial[1], trial[2]
    return worst <= MOMENT_ERROR
