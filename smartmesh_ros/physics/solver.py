"""What PyBullet is told about solving contacts."""

from __future__ import annotations

from typing import Any

from smartmesh_ros.physics.config import PhysicsConfig

# PyBullet keeps a contact point until it has moved by this share of the body's size; at its default of 0.02 the points
# that a rolling body leaves behind hold it back and make it hop. Far smaller values let boxes creep down slopes. The
# value holds for all worlds of a process.
CONTACT_BREAKING = 2e-4


def set_up(client: Any, physics: PhysicsConfig) -> None:
    """Gives a client its gravity, its time step and what it needs for contacts."""
    client.setGravity(*physics.gravity)
    client.setTimeStep(physics.dt)
    client.setPhysicsEngineParameter(
        contactERP=physics.contact_erp,
        erp=physics.contact_erp,
        contactBreakingThreshold=CONTACT_BREAKING,
        solverResidualThreshold=physics.solver_residual,
    )
