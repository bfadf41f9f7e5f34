"""One step of a PyBullet world on moving ground: refresh the patches, rescue.

`World` steps its own PyBullet client this way, and `Ground.step` steps that of a user.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig
from smartmesh_ros.ground.guard import Guard
from smartmesh_ros.ground.update_schedule import UpdateSchedule

if TYPE_CHECKING:
    from smartmesh_ros.ground.ground import Ground

# Largest relative difference between two step lengths that counts as rounding.
ROUNDING = 1e-9


@dataclass(eq=False)
class StepCounts:
    """``refreshes``: refreshes of the patches so far. ``rescues``: bodies put back onto the ground so far."""

    refreshes: int = 0
    rescues: int = 0


class Stepper:
    """Steps a PyBullet world whose bodies stand on one `Ground`.

    ``drop_lost`` is called after each refresh; it removes bodies whose position is not finite or too far away, and
    returns True if it removed any.
    """

    def __init__(self, client: Any, ground: Ground) -> None:
        self.counts = StepCounts()
        self.drop_lost: Callable[[], bool] = lambda: False
        self._client = client
        self._ground = ground
        self._schedule = UpdateSchedule()
        self._guard = Guard(ground)

    def refresh(self, time: float, physics: PhysicsConfig, *, behind_real_time: bool = False) -> None:
        """Refresh the patches at ``time`` [s], and put bodies below the ground back onto it. ``behind_real_time``: as
        in `UpdateSchedule.begin`."""
        self.counts.refreshes += 1
        ground, dt = self._ground, physics.dt
        steps = self._schedule.begin(ground.terrain, time, dt, ground.config.rate, behind_real_time=behind_real_time)
        ground.update(time, dt, steps)
        if self.drop_lost():
            ground.update(time, dt, steps)
        rescued = self._guard.rescue(self._client, time) if physics.guard else 0
        if rescued:
            self.counts.rescues += rescued
            ground.update(time, dt, steps)

    def prepare(self, time: float, physics: PhysicsConfig, *, behind_real_time: bool = False) -> None:
        """Refresh the patches if they are due at ``time`` [s]; otherwise let them move on with the ground."""
        ground = self._ground
        if ground.stale or self._schedule.due(ground.terrain, behind_real_time=behind_real_time):
            self.refresh(time, physics, behind_real_time=behind_real_time)
        elif ground.go_on(time, physics.dt):
            self.counts.refreshes += 1


def physics_of(client: Any, dt: float) -> PhysicsConfig:
    """Return the gravity and time step of a client, for steps of ``dt`` [s]; raises `InputError` if the client has
    another time step."""
    settings = client.getPhysicsEngineParameters()
    step = float(settings["fixedTimeStep"])
    if not (math.isfinite(dt) and abs(dt - step) <= ROUNDING * step):
        raise InputError(
            "parameter", f"dt is {dt} s, but PyBullet steps {step} s; call setTimeStep({dt}) or pass dt={step}"
        )
    x, y, z = (float(settings[f"gravityAcceleration{axis}"]) for axis in "XYZ")
    return PhysicsConfig(rate=1.0 / dt, gravity=(x, y, z))
