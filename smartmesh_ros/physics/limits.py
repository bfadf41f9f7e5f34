"""What the physics engine can compute with.

PyBullet squares and inverts what it is given: a spin of 1e200 rad/s, or a mass of 1e-300 kg, makes numbers that are
none, and they spread to whatever the body touches.
"""

from __future__ import annotations

import math

from smartmesh_ros.errors import InputError
from smartmesh_ros.physics.state import BodyState

FARTHEST_BODY = 1e7  # from the frame's origin [m]
FASTEST = 1e5  # [m/s]
FASTEST_SPIN = 1e5  # [rad/s]
STRONGEST = 1e12  # joint [Nm, N]
SIZES = (1e-4, 1e4)  # of shapes and radii [m]
MASSES = (1e-6, 1e9)  # [kg]


def require_possible(name: str, state: BodyState) -> None:
    """Raises `InputError` where a body is farther away or faster than anything simulated here."""
    for what, values, most, unit in (
        ("position", state.position, FARTHEST_BODY, "m"),
        ("velocity", state.linear, FASTEST, "m/s"),
        ("angular velocity", state.angular, FASTEST_SPIN, "rad/s"),
    ):
        if max(map(abs, values)) > most:
            raise InputError("geometry", f"{what} of {name!r} is {values} {unit}; at most {most:g} is possible")


def require_between(what: str, value: float, bounds: tuple[float, float], unit: str) -> None:
    """Raises `InputError` where a value is not within its bounds, or is no number."""
    low, high = bounds
    if not (math.isfinite(value) and value > 0.0):
        raise InputError("geometry", f"{what} is {value} {unit}; it must be greater than zero")
    if not low <= value <= high:
        raise InputError("geometry", f"{what} is {value} {unit}; it must be {low:g} to {high:g}")
