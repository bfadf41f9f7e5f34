"""Bodies that fall off the ground, and bodies at impossible places."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from smartmesh_ros.errors import listed
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.ground.limits import FARTHEST_BODY
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.world.settings import FallConfig

NOWHERE = f"was at no place or farther away than {FARTHEST_BODY:g} m"


class Falls:
    """Finds awake bodies of this world that fall because there is no ground under them, and those that are lost: too
    far below the ground, or at no possible place. ``checked``: time of the last check [s]."""

    def __init__(self, ground: Ground, config: FallConfig) -> None:
        self.config = config
        self.checked = math.inf
        self._ground = ground

    @property
    def falling(self) -> dict[str, Vector]:
        """The bodies that fall, by name: where they left the ground [m]."""
        core = self._ground.contacts.core
        return {self._name(slot): core.last_ground(slot) for slot in core.find_falling()}

    def check(self, time: float) -> tuple[str, dict[str, str]]:
        """Check all awake bodies at ``time`` [s]; falling ones only if a period is over since the last check. Returns a
        line about bodies that began to fall, empty if none did; and why bodies are lost, by name."""
        core, config = self._ground.contacts.core, self.config
        if core.find_nowhere(FARTHEST_BODY):
            self._ground.drop_gone()
            return "", {self._name(slot): NOWHERE for slot in core.find_nowhere(FARTHEST_BODY)}
        if 0.0 <= time - self.checked < config.period or self._ground.terrain.empty:
            return "", {}
        self.checked = time
        begun, lost = core.check_falls(time, config.depth)
        return self._words(begun), {self._name(slot): self._why(slot) for slot in lost}

    def _words(self, slots: list[int]) -> str:
        if not slots:
            return ""
        places = self._ground.contacts.states_of(np.array(slots))[:, :3]
        names = [f"{self._name(slot)!r} at {_text(place)}" for slot, place in zip(slots, places, strict=True)]
        falls = "falls" if len(names) == 1 else "fall"
        return (
            f"{listed(names, self.config.most)} {falls}: there is no ground there. Publish some, or move the body "
            f"back; one that is {self.config.depth:g} m below the ground that it left is removed"
        )

    def _why(self, slot: int) -> str:
        place = _text(self._ground.contacts.core.last_ground(slot))
        return f"was {self.config.depth:g} m below the ground at {place}, which it left"

    def _name(self, slot: int) -> str:
        return self._ground.followers[slot].name.partition("/")[0]


def _text(place: Iterable[float]) -> str:
    return f"({', '.join(f'{value:.2f}' for value in place)}) m"
