"""Settings of bases that drive."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from smartmesh_ros.errors import InputError, is_number, require

# Largest length of a base [m].
LARGEST = 1e4


@dataclass(frozen=True, kw_only=True)
class BaseConfig:
    """How a robot drives: by ``wheels`` (names of joints), which ``steering`` joints may turn, or by ``tracks`` (names
    of driven surfaces).

    Sides, radii and distances are those of the robot. What is given instead of zero replaces them: ``radius`` of all
    wheels [m]; ``track`` [m], the distance of left from right by which a base without steering turns; ``wheelbase``
    [m], from the axle that is not steered to that which is.
    ``linear_limit`` [m/s], ``angular_limit`` [rad/s]: largest speeds; ``linear_acceleration`` [m/s^2],
    ``angular_acceleration`` [rad/s^2]: largest changes of the commanded speeds. Raises `InputError`.
    """

    wheels: tuple[str, ...] = ()
    steering: tuple[str, ...] = ()
    tracks: tuple[str, ...] = ()
    radius: float = 0.0
    track: float = 0.0
    wheelbase: float = 0.0
    linear_limit: float = math.inf
    angular_limit: float = math.inf
    linear_acceleration: float = math.inf
    angular_acceleration: float = math.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value, what = getattr(self, field.name), f"{field.name} of a base"
            if field.name in ("wheels", "steering", "tracks"):
                good = isinstance(value, list | tuple) and all(isinstance(name, str) and name for name in value)
                require(good and len({*value}) == len(value), "base", what, value, "a list of different names")
                object.__setattr__(self, field.name, tuple(value))
                continue
            require(is_number(value), "base", what, value, "a number")
            if field.default:
                require(value > 0.0, "base", what, value, "above zero")
            else:
                require(0.0 <= value <= LARGEST, "base", what, value, f"0 to {LARGEST:g} m; 0 = that of the robot")
        if bool(self.wheels) == bool(self.tracks) or (self.tracks and self.steering):
            raise InputError("base", "a base has wheels, with or without steering, or tracks: name either's joints")
        if self.steering and (self.track or self.angular_acceleration < math.inf):
            raise InputError("base", "a base that is steered has no track and no angular_acceleration; leave them out")
        if self.wheelbase and not self.steering:
            raise InputError("base", "a base without steering has no wheelbase; leave it out")
