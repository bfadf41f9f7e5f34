"""What takes part in the steps of a world."""

from __future__ import annotations

from typing import Protocol


class StepWatcher(Protocol):
    """What takes part in the steps of a world, such as a sensor."""

    def before_step(self) -> None:
        """Do what is to be done right before the physics of a step."""

    def after_step(self) -> None:
        """Do what is to be done right after it, at the world's new time."""
