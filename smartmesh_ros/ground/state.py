"""Pose and velocity of a body."""

import math
from dataclasses import dataclass

from smartmesh_ros.errors import InputError

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

# Columns of a table of bodies (N, 13): position [m], orientation (x, y, z, w), velocity [m/s], angular velocity
# [rad/s].
BODY_COLUMNS = 13
# Largest accepted difference between a quaternion's length and one.
QUATERNION_SLACK = 1e-3


@dataclass(frozen=True)
class BodyState:
    """Position [m] and orientation (x, y, z, w) of the centre of mass, its velocity [m/s] and angular velocity [rad/s],
    all in the terrain's frame. Raises `InputError` if a number is not finite or the orientation is not a unit
    quaternion."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("position", "orientation", "linear", "angular"):
            if not all(math.isfinite(value) for value in getattr(self, name)):
                raise InputError("non_finite", f"{name} is {getattr(self, name)}; every number must be finite")
        length = math.hypot(*self.orientation)
        if abs(length - 1.0) > QUATERNION_SLACK:
            raise InputError(
                "quaternion", f"orientation {self.orientation} has length {length:.4g}; a rotation has length 1"
            )
