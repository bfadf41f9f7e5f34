"""Ranges of values that PyBullet can compute with.

PyBullet squares and inverts its inputs. A spin of 1e200 rad/s or a mass of 1e-300 kg overflows to NaN, and the NaN
spreads to every body in contact.
"""

from __future__ import annotations

import math

from smartmesh_ros.errors import InputError, as_float
from smartmesh_ros.ground.state import BodyState

FARTHEST_BODY = 1e7  # largest coordinate of a body in the terrain's frame [m]
FASTEST = 1e5  # [m/s]
FASTEST_SPIN = 1e5  # [rad/s]
STRONGEST = 1e12  # effort of a joint [Nm, N]
SIZES = (1e-4, 1e4)  # of shapes and radii [m]
MASSES = (1e-6, 1e9)  # [kg]


def require_possible(name: str, state: BodyState) -> None:
    """Raise `InputError` if a state is none, or a body is farther away or faster than the limits."""
    if not isinstance(state, BodyState):
        raise InputError("type", f"the state of {name!r} is {state!r}; pass BodyState(position, ...)")
    for what, values, most, unit in (
        ("position", state.position, FARTHEST_BODY, "m"),
        ("velocity", state.linear, FASTEST, "m/s"),
        ("angular velocity", state.angular, FASTEST_SPIN, "rad/s"),
    ):
        if max(map(abs, values)) > most:
            reason = what.replace(" ", "_")
            raise InputError(reason, f"{what} of {name!r} is {values} {unit}; at most {most:g} is possible")


def require_between(what: str, value: float, bounds: tuple[float, float], unit: str) -> None:
    """Raise `InputError` if a value is not finite or not within its bounds."""
    low, high = bounds
    if not (math.isfinite(as_float(value)) and value > 0.0):
        raise InputError("geometry", f"{what} is {value} {unit}; it must be finite and greater than zero")
    if not low <= value <= high:
        raise InputError("geometry", f"{what} is {value} {unit}; it must be {low:g} to {high:g}")
