"""What the ground does between two maps."""

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.terrain.grid import FloatArray

MotionMode = Literal["hold", "extrapolate", "interpolate"]

# The source is late, not gone, until an age of PATIENCE map intervals; extrapolation then runs back to the last map
# at half the ground's speed, so that nothing is ever teleported.
PATIENCE = 1.5
# After an age of REST map intervals the ground is at rest at the last map's heights.
REST = 3.0 * PATIENCE


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """How a map that arrives at 10-60 Hz moves under faster physics.

    ``mode``: *hold* keeps the last map's heights and carries its velocity; *extrapolate* also moves the heights on;
    *interpolate* runs from the map before to the last one, one map late.
    ``max_interval`` [s]: maps further apart than this say nothing about velocity.
    ``max_velocity`` [m/s]: ground that moves faster between two maps has jumped (a correction, a new crater).
    """

    mode: MotionMode = "extrapolate"
    max_interval: float = 0.25
    max_velocity: float = 25.0

    def __post_init__(self) -> None:
        if self.mode not in get_args(MotionMode):
            raise InputError(
                "parameter", f"terrain motion {self.mode!r} is unknown; choose {', '.join(get_args(MotionMode))}"
            )
        if not self.max_interval > 0.0 or not self.max_velocity > 0.0:
            raise InputError("parameter", "terrain max_interval [s] and max_velocity [m/s] must be greater than zero")


class Progress(NamedTuple):
    """How far the ground is along its velocity: height = map + velocity * offset, speed = velocity * rate."""

    offset: FloatArray
    rate: FloatArray


def progress(mode: MotionMode, age: FloatArray, interval: FloatArray) -> Progress:
    """Offset [s] and rate [-] of ground whose last map is ``age`` seconds old and came ``interval`` after the one
    before; arrays of one shape. ``rate`` is the derivative of ``offset`` (in *hold*, of what the offset leaves out).
    """
    patience = PATIENCE * interval
    fresh = age <= patience
    if mode == "hold":
        return Progress(np.zeros_like(age), fresh.astype(np.float64))
    if mode == "interpolate":
        return Progress(np.clip(age - interval, -interval, 0.0), (age < interval).astype(np.float64))
    returning = ~fresh & (age < REST * interval)
    offset = np.where(fresh, np.maximum(age, -interval), np.maximum(patience - 0.5 * (age - patience), 0.0))
    rate = np.where(fresh, 1.0, np.where(returning, -0.5, 0.0))
    return Progress(offset, rate)
