"""Surfaces of bodies and links that move, as those of tracks and conveyors do."""

from __future__ import annotations

import math
from dataclasses import dataclass

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.limits import FARTHEST_BODY, FASTEST
from smartmesh_ros.ground.state import Vector

# Shortest axis [any unit].
LEAST_AXIS = 1e-6


@dataclass(frozen=True)
class Belt:
    """How the surface of a body or link moves: where the ground touches it with a normal n, along n x ``axis`` at a
    ``speed`` [m/s].

    A positive speed drives the body as a wheel that turns about ``axis``, a vector of any length in the frame of the
    centre of mass. Raises `InputError` if the axis is zero or a number is not finite.
    """

    axis: Vector = (0.0, 1.0, 0.0)
    speed: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", tuple(map(float, self.axis)))  # to be compared and saved
        object.__setattr__(self, "speed", float(self.speed))
        length = math.hypot(*self.axis) if len(self.axis) == 3 else math.nan
        if not LEAST_AXIS <= length <= FARTHEST_BODY:
            raise InputError("surface", f"the axis of a surface is {self.axis}; it must be three numbers, not all zero")
        if not abs(self.speed) <= FASTEST:  # also True for NaN
            raise InputError(
                "non_finite", f"the speed of a surface is {self.speed} m/s; it must be finite, to {FASTEST:g}"
            )
