"""Which colliders touch which bodies.

PyBullet remembers a rule for a pair of bodies for ever, also when one of them is removed and another body gets its
number. `Pairs` keeps track of the rules it made, so that a body with a collider's old number is not haunted by them.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import pybullet as pb


class Pairs:
    """The rules of colliders in one PyBullet world."""

    def __init__(self, client: Any) -> None:
        self._client: int = getattr(client, "_client", 0)
        self._rules: dict[int, set[tuple[int, int, int]]] = defaultdict(set)  # by collider: its link, body, body's link

    def claim(self, collider: int) -> None:
        """Makes a new collider touch nothing, whatever had its number before."""
        for link in range(-1, pb.getNumJoints(collider, self._client)):
            # PyBullet lets two bodies touch if either's mask holds the other's group: the group has to be empty, too.
            pb.setCollisionFilterGroupMask(collider, link, 0, 0, self._client)
        self._set_all(collider, 0)

    def join(self, collider: int, body: int, link: int) -> None:
        """Makes a collider touch one body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            self._rules[collider].add((part, body, link))
            pb.setCollisionFilterPair(collider, body, part, link, 1, self._client)

    def part(self, collider: int, body: int, link: int) -> None:
        """Makes a collider touch that body or link no more."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            pb.setCollisionFilterPair(collider, body, part, link, 0, self._client)

    def retire(self, collider: int) -> None:
        """To be called before a collider is removed: a body that gets its number touches others as any body does."""
        self._set_all(collider, 1)

    def _set_all(self, collider: int, touch: int) -> None:
        for part, body, link in self._rules.get(collider, ()):
            pb.setCollisionFilterPair(collider, body, part, link, touch, self._client)
