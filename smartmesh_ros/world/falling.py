"""Bodies that fall off the ground, noticed once and given up far below it, and bodies at impossible places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmesh_ros.errors import InputError
from smartmesh_ros.ground.ground import Ground
from smartmesh_ros.ground.limits import FARTHEST_BODY
from smartmesh_ros.ground.state import Vector
from smartmesh_ros.patches.tables import with_rows
from smartmesh_ros.terrain.grid import FloatArray
from smartmesh_ros.terrain.state_file import filled

NOWHERE = f"was at no place or farther away than {FARTHEST_BODY:g} m"


@dataclass(frozen=True, kw_only=True)
class FallConfig:
    """``depth`` [m]: a body this far below the ground that it left is lost. ``period`` [s]: simulated time between
    checks; shorter ones tell the place where a body left the ground more exactly. ``most``: bodies that one line
    names."""

    depth: float = 100.0
    period: float = 0.1
    most: int = 5

    def __post_init__(self) -> None:
        if not 0.0 < self.depth <= FARTHEST_BODY:
            raise InputError("parameter", f"lost depth is {self.depth} m; it must be above 0, to {FARTHEST_BODY:g}")


class Falls:
    """Which of the awake bodies of a world's own fall, because there is no ground under them. Of a robot, its first
    attached link counts."""

    def __init__(self, ground: Ground, config: FallConfig) -> None:
        self.config = config
        self._ground = ground
        # By slot: the last place with ground under the body, or else that of its first check [m]; and whether it falls.
        self._last_w, self._falling = np.empty((0, 3)), np.zeros(0, np.bool_)
        self._checked = np.inf  # time of the last check [s]
        ground.followers.tables.append(self)

    def grow(self, slots: int) -> None:
        """Make room for ``slots`` slots."""
        self._last_w, self._falling = with_rows(self._last_w, slots, np.nan), with_rows(self._falling, slots, False)

    def clear(self, slot: int) -> None:
        """Forget a follower that is removed."""
        self._last_w[slot], self._falling[slot] = np.nan, False

    def memory(self, slots: list[int]) -> dict[str, Any]:
        """Return what is known of the past of followers."""
        return {"checked": self._checked, "last": self._last_w[slots], "falling": self._falling[slots]}

    def recall(self, slots: list[int], memory: dict[str, Any]) -> None:
        """Take over what `memory` returned, in the same order. Raises `InputError` if it is none of these followers."""
        last, falling = self._last_w[slots], self._falling[slots]
        filled(last, memory["last"])
        filled(falling, memory["falling"])
        self._last_w[slots], self._falling[slots], self._checked = last, falling, float(memory["checked"])

    @property
    def falling(self) -> dict[str, Vector]:
        """The bodies that fall, by name: where they left the ground [m]."""
        return {self._name(slot): self._place(slot) for slot in np.flatnonzero(self._falling).tolist()}

    def check(self, time: float) -> tuple[list[str], dict[str, str]]:
        """Look at all awake bodies at ``time`` [s], for falling ones if that is due. Returns a line about those that
        began to fall, if any did, and, by name, why bodies are lost."""
        contacts, followers, config = self._ground.contacts, self._ground.followers, self.config
        if nowhere := contacts.find_nowhere(FARTHEST_BODY):
            return [], {self._name(slot): NOWHERE for slot in nowhere}
        if 0.0 <= time - self._checked < config.period or self._ground.terrain.empty:
            return [], {}
        own = np.setdiff1d(np.flatnonzero(followers.table["own"]), contacts.asleep())
        if not own.size:
            return [], {}
        self._checked = time
        slots = own[np.unique(followers.bodies[own], return_index=True)[1]]
        positions = contacts.states_of(slots)[:, :3]
        ground = self._ground.terrain.at(positions[:, :2], time).heights
        over = ~np.isnan(ground)
        places = np.column_stack([positions[:, :2], np.where(over, ground, positions[:, 2])])
        chosen = over | np.isnan(self._last_w[slots, 2])
        self._last_w[slots[chosen]] = places[chosen]
        depths = self._last_w[slots, 2] - positions[:, 2]
        falling = ~over & (depths > followers.radii[slots])
        new = slots[falling & ~self._falling[slots]].tolist()
        self._falling[slots] = falling
        lost = slots[~over & (depths > config.depth)].tolist()  # one below ground is put back onto it
        return self._words(new, positions[np.isin(slots, new)]), {self._name(slot): self._why(slot) for slot in lost}

    def _words(self, slots: list[int], places: FloatArray) -> list[str]:
        if not slots:
            return []
        names = [f"{self._name(slot)!r} at {_text(place)}" for slot, place in zip(slots, places, strict=True)]
        more = f" and {len(names) - self.config.most} more" if len(names) > self.config.most else ""
        few, falls = ", ".join(names[: self.config.most]), "falls" if len(names) == 1 else "fall"
        return [
            f"{few}{more} {falls}: there is no ground there. Publish some, or move the body back; one that is "
            f"{self.config.depth:g} m below the ground that it left is removed"
        ]

    def _why(self, slot: int) -> str:
        return f"was {self.config.depth:g} m below the ground at {_text(self._last_w[slot])}, which it left"

    def _name(self, slot: int) -> str:
        return self._ground.followers[slot].name.partition("/")[0]

    def _place(self, slot: int) -> Vector:
        x, y, z = self._last_w[slot].tolist()
        return x, y, z


def _text(place: np.ndarray) -> str:
    return f"({', '.join(f'{value:.2f}' for value in place)}) m"
