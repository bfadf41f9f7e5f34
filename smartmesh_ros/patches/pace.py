"""How often patches are brought up to date, and for how long looks at bodies hold."""

from __future__ import annotations

from typing import NamedTuple

# A choice holds for so many steps of the physics where the ground moves, or for fewer where its velocity changes.
HORIZON, SHORT_HORIZON = 8, 4
# For how many steps of travel a look holds: more while that is no further than a share of the body's radius.
STEPS, MORE_STEPS = 4, 8


class Pace(NamedTuple):
    """Patches are brought up to date every ``dt`` [s], which is so many ``steps`` of the physics.

    What looks hold for is told in updates, of which there is one at least.
    """

    dt: float
    steps: int = 1

    @property
    def horizon(self) -> float:
        """Updates a choice holds for where the ground moves."""
        return max(HORIZON / self.steps, 1.0)

    @property
    def short_horizon(self) -> float:
        """The same where its velocity changes."""
        return max(SHORT_HORIZON / self.steps, 1.0)

    @property
    def travel(self) -> float:
        """Updates' worth of a body's motion that a look holds for."""
        return max(STEPS / self.steps, 1.0)

    @property
    def more_travel(self) -> float:
        """The same of bodies that move little."""
        return max(MORE_STEPS / self.steps, 1.0)
