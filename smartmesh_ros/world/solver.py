"""Settings of PyBullet's contact solver."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.ground.config import PhysicsConfig

# Motion at which PyBullet drops a cached contact point [body sizes]. At PyBullet's default of 0.02 a rolling body is
# held back by old contact points and hops. Far smaller values let boxes creep down slopes. PyBullet shares the value
# among all worlds of a process.
CONTACT_BREAKING = 2e-4


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
