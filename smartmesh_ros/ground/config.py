"""Settings of the physics and of PyBullet's solver, and of sleeping bodies."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from smartmesh_ros.errors import InputError, as_float, require, require_flag, require_not_negative
from smartmesh_ros.ground.state import Vector


@dataclass(frozen=True, kw_only=True)
class PhysicsConfig:
    """How the world is stepped.

    ``rate`` [Hz]: steps per simulated second. ``gravity`` [m/s^2]. ``friction``: Coulomb coefficient of every simulated
    body against the ground, and of the links of robots whose URDF gives none. ``restitution``: ratio of rebound speed
    to impact speed, for the same bodies and links. ``contact_erp``: share of a
    penetration that the solver corrects in one step.
    ``sleep``: bodies at rest on ground at rest fall asleep, and wake in the step in which anything touches them.
    ``solver_residual`` [m^2/s^2]: PyBullet's ``solverResidualThreshold``; the solver's 50 iterations end early once
    none changes a contact's velocity by more than the square root of this value.
    """

    rate: float = 240.0
    gravity: Vector = (0.0, 0.0, -9.81)
    friction: float = 0.5
    restitution: float = 0.0
    contact_erp: float = 0.3
    sleep: bool = True
    solver_residual: float = 1e-9

    def __post_init__(self) -> None:
        good = 0.0 < as_float(self.rate) < math.inf and self.dt < math.inf
        require(good, "parameter", "physics rate", self.rate, "finite and greater than zero [Hz]")
        require_flag(self.sleep, "parameter", "physics sleep")
        gravity = tuple(map(as_float, self.gravity)) if isinstance(self.gravity, Iterable) else ()
        good = len(gravity) == 3 and all(map(math.isfinite, gravity))
        require(good, "parameter", "gravity", self.gravity, "three finite numbers [m/s^2]")
        object.__setattr__(self, "gravity", gravity)  # to be compared and saved
        for name in ("friction", "solver_residual"):
            value = getattr(self, name)
            require(0.0 <= as_float(value) < math.inf, "parameter", name, value, "zero or more")
        require(0.0 <= as_float(self.restitution) <= 1.0, "parameter", "restitution", self.restitution, "0 to 1")
        good = 0.0 < as_float(self.contact_erp) <= 1.0
        require(good, "parameter", "contact_erp", self.contact_erp, "above 0 and at most 1")

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return 1.0 / self.rate


@dataclass(frozen=True, kw_only=True)
class SleepConfig:
    """When bodies fall asleep and wake.

    ``after`` [s], ``distance`` [m]: a body that rests on something is still if no point of it moved farther than
    ``distance`` for the time ``after``, which grows where gravity is weaker than the Earth's. This is a mean speed of 2
    mm/s. Contacts at rest tremble faster at times, but go nowhere; a ball on a slope of 0.5 degrees moves by 8 mm in
    this time. ``joint`` [rad/s, m/s]: a robot falls asleep only while none of its joints is faster. ``ground`` [m]: a
    sleeping body wakes when the ground under it has changed by more than this since it fell asleep. ``noise``,
    ``most``: on maps whose noise is fused, a change may also be this many standard deviations of the estimate, unless
    that is more than ``most`` [m], as after the first few maps; the body follows it asleep. With 3, noise of 5 mm wakes
    a body about once in five seconds; raising ``most`` lets bodies sleep deeper in the ground, and on noisier maps.
    """

    after: float = 0.5
    distance: float = 1e-3
    joint: float = 0.02
    ground: float = 2.5e-4
    noise: float = 3.0
    most: float = 5e-3

    def __post_init__(self) -> None:
        require_not_negative(self, "sleep")


# Motion at which PyBullet drops a cached contact point [body sizes]: its default. Contacts from the map are found anew
# in each step. Contacts of hulls and cylinders with other bodies come one in a step, so that a box on them rattles and
# turns if the others are dropped. PyBullet shares the value among all worlds of a process.
CONTACT_BREAKING = 0.02
# Largest relative difference between two step lengths that counts as rounding, of 32-bit numbers, too.
ROUNDING = 1e-7


def set_up(client: Any, physics: PhysicsConfig) -> None:
    """Set the gravity, time step and contact parameters of a client."""
    client.setGravity(*physics.gravity)
    client.setTimeStep(physics.dt)
    client.setPhysicsEngineParameter(
        contactERP=physics.contact_erp,
        erp=physics.contact_erp,
        contactBreakingThreshold=CONTACT_BREAKING,
        solverResidualThreshold=physics.solver_residual,
    )


def time_step_of(client: Any) -> float:
    """Return the time step of a client [s]."""
    return float(client.getPhysicsEngineParameters()["fixedTimeStep"])


def require_time_step(client: Any, dt: float) -> None:
    """Raise `InputError` if a client does not step ``dt`` [s]."""
    step = time_step_of(client)
    if not abs(as_float(dt) - step) <= ROUNDING * step:
        raise InputError(
            "parameter", f"dt is {dt} s, but PyBullet steps {step} s; call setTimeStep({dt}) or pass dt={step}"
        )
