"""What is known of another world and of the remote bodies that it simulates."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from smartmesh_ros.world.settings import GuestConfig
from smartmesh_ros.world.state_table import StateTable

# Largest number of received states that are not used yet; a quarter of a second at 240 Hz.
MOST_PENDING = 64


@dataclass(eq=False)
class Guest:
    """A remote body in this world. ``touched``: first and last time that it touched another body since its owner's
    states were last used unchanged [s], None = no contact since."""

    row: int  # index in its owner's states
    uid: int
    touched: tuple[float, float] | None = None


class Received(NamedTuple):
    """States of all bodies of an owner, and the time at which they hold [s]."""

    states: StateTable
    time: float


@dataclass(eq=False)
class GuestOwner:
    """Another world, which simulates remote bodies.

    ``pending``: received states that are too young to be used. ``now``: the states in use, None before the first.
    ``new``: True until the ``guests`` are set to ``now``. ``delay`` [s]: estimated delay of its states. ``listed``,
    ``names``: of its bodies, in order and as a set. ``shared``: names that are also used by other worlds, whose bodies
    cannot be guests. ``phase``: lag of its steps behind this world's [steps], None before the first states.
    """

    pending: deque[Received] = field(default_factory=lambda: deque(maxlen=MOST_PENDING))
    now: Received | None = None
    new: bool = False
    delay: float = 0.0
    guests: dict[str, Guest] = field(default_factory=dict)
    listed: list[str] = field(default_factory=list)
    names: frozenset[str] = frozenset()
    shared: frozenset[str] = frozenset()
    phase: float | None = None

    def to_own_steps(self, steps: float, config: GuestConfig) -> int:
        """Return the whole number of this world's steps for a time of ``steps`` steps that the owner sent."""
        if self.phase is None:
            self.phase = steps - round(steps)
        whole = round(steps - self.phase)
        self.phase += config.drift * (steps - whole - self.phase)
        if abs(self.phase) > config.slip:
            self.phase -= math.copysign(1.0, self.phase)
        return whole
