"""Settings of guests."""

from __future__ import annotations

import math
from dataclasses import dataclass

from smartmesh_ros.errors import InputError


@dataclass(frozen=True, kw_only=True)
class GuestConfig:
    """How guests come, follow and go."""

    # Bodies of others that come so near to an own one, surface to surface, become guests [m]: a row of balls passes an
    # impact on as far as that.
    margin: float = 1.0
    # Also those that may come there in this time at the speed they have to each other [s]: longer than states are late.
    horizon: float = 0.2
    # They remain guests up to so many margins, so that none comes and goes at every step.
    stay: float = 1.5
    # Worlds find the same contact up to so many steps apart: a state is used when it is so old.
    steps_apart: int = 2
    # In lasting contact the distance to the owner's state shrinks to 1/e in this time, or in the time that its states
    # are late if that is longer [s]: what pulls faster than it is told swings.
    settle: float = 0.03
    # A state is moved on no farther than this [s]: a velocity says nothing of what comes later.
    max_extrapolation: float = 0.2
    # Bodies are asked for contacts where the balls around them are so near [m]: PyBullet's contacts reach as far.
    touching: float = 0.02
    # A delay that was longer is forgotten by this share at each state.
    forget: float = 0.05
    # States are taken to hold at the nearest step of this world, since both worlds are to find an impact at the same
    # depth. By how much the owner's steps come later is followed by this share at each state.
    drift: float = 0.02
    # Beyond so many steps the next step is the nearest: between half, where it could be either, and one.
    slip: float = 0.7

    def __post_init__(self) -> None:
        if not (math.isfinite(self.margin) and self.margin > 0.0):
            raise InputError("parameter", f"the margin of guests is {self.margin} m; it must be greater than zero")
