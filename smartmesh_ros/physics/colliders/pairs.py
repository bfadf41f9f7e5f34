"""Rules for which colliders touch which bodies.

PyBullet keeps the rule of a pair of bodies for ever, even after one of them is removed and a new body gets its id.
`Pairs` records its rules and resets them, so that a new body does not inherit the rules of a removed collider.
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
        """Make a new collider touch nothing, and reset the rules of removed colliders with the same id."""
        for link in range(-1, pb.getNumJoints(collider, self._client)):
            # PyBullet lets two bodies touch if either mask contains the other's group, so the group must be empty, too.
            pb.setCollisionFilterGroupMask(collider, link, 0, 0, self._client)
        self._set_all(collider, 0)

    def join(self, collider: int, body: int, link: int) -> None:
        """Makes a collider touch one body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            self._rules[collider].add((part, body, link))
            pb.setCollisionFilterPair(collider, body, part, link, 1, self._client)

    def part(self, collider: int, body: int, link: int) -> None:
        """Stop a collider from touching a body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            pb.setCollisionFilterPair(collider, body, part, link, 0, self._client)

    def retire(self, collider: int) -> None:
        """Reset a collider's rules before the collider is removed, so that a body that gets its id touches others
        normally."""
        self._set_all(collider, 1)

    def _set_all(self, collider: int, touch: int) -> None:
        for part, body, link in self._rules.get(collider, ()):
            pb.setCollisionFilterPair(collider, body, part, link, touch, self._client)
