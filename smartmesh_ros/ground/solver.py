"""Settings of PyBullet's contact solver."""

from __future__ import annotations

import math
from typing import Any

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.config import PhysicsConfig

# Motion at which PyBullet drops a cached contact point [body sizes]. At PyBullet's default of 0.02 a rolling body is
# held back by old contact points and hops. Far smaller values let boxes creep down slopes. PyBullet shares the value
# among all worlds of a process.
CONTACT_BREAKING = 2e-4
# Largest relative difference between two step lengths that counts as rounding.
ROUNDING = 1e-9


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


def gravity_of(client: Any, dt: float) -> float:
    """Return the gravity of a client [m/s^2]; raises `InputError` if it does not step ``dt`` [s]."""
    settings = client.getPhysicsEngineParameters()
    step = float(settings["fixedTimeStep"])
    if not (math.isfinite(dt) and abs(dt - step) <= ROUNDING * step):
        raise InputError(
            "parameter", f"dt is {dt} s, but PyBullet steps {step} s; call setTimeStep({dt}) or pass dt={step}"
        )
    return math.hypot(*(float(settings[f"gravityAcceleration{axis}"]) for axis in "XYZ"))
