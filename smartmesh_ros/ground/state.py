"""Pose and velocity of a body."""

import math
from dataclasses import dataclass

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.deck import QUATERNION_SLACK

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# Columns of a table of bodies (N, 13): position [m], orientation (x, y, z, w), velocity [m/s], angular velocity
# [rad/s].
BODY_COLUMNS = 13
SIZES = (("position", 3), ("orientation", 4), ("linear", 3), ("angular", 3))


@dataclass(frozen=True)
class BodyState:
    """Position [m] and orientation (x, y, z, w) of the centre of mass, its velocity [m/s] and angular velocity [rad/s],
    all in the terrain's frame. Raises `InputError` if a number is missing or not finite, or the orientation is not a
    unit quaternion."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, count in SIZES:
            given = getattr(self, name)
            try:
                values = given if type(given) is tuple else tuple(map(float, given))
                finite = all(map(math.isfinite, values))
            except (TypeError, ValueError):
                values = ()
            if len(values) != count:
                raise InputError("length", f"{name} is {given!r}; it must be {count} numbers")
            if not finite:
                raise InputError("non_finite", f"{name} is {given}; every number must be finite")
            if values is not given:
                object.__setattr__(self, name, values)  # to be compared and saved
        length = math.hypot(*self.orientation)
        if abs(length - 1.0) > QUATERNION_SLACK:
            words = f"orientation {self.orientation} has length {length:.4g}; a rotation has length 1"
            raise InputError("quaternion", words)
