"""Rules for which colliders touch which bodies.

PyBullet keeps the rule of a pair of ids for ever, even after a body is removed and a new one gets its id. An id of a
collider may go to a body, and an id of a body to a collider. `Pairs` records its rules under both ids and resets them,
so that no pair inherits the rule of an earlier one. A body that touched another body's collider from below would be
thrown.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import pybullet as pb


class Pairs:
    """The rules of colliders in one PyBullet world."""

    def __init__(self, client: Any) -> None:
        self._client: int = getattr(client, "_client", 0)
        self._colliders: set[int] = set()  # claimed and not retired
        # By id, of bodies and colliders: its link, the other id, and the other's link.
        self._rules: dict[int, set[tuple[int, int, int]]] = defaultdict(set)

    def claim(self, collider: int) -> None:
        """Make a new collider touch nothing, and reset the rules of removed bodies and colliders with the same id."""
        for link in range(-1, pb.getNumJoints(collider, self._client)):
            # PyBullet lets two bodies touch if either mask contains the other's group, so the group must be empty, too.
            pb.setCollisionFilterGroupMask(collider, link, 0, 0, self._client)
        self._colliders.add(collider)
        self._reset(collider)

    def join(self, collider: int, body: int, link: int) -> None:
        """Makes a collider touch one body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            self._rules[collider].add((part, body, link))
            self._rules[body].add((link, collider, part))
            pb.setCollisionFilterPair(collider, body, part, link, 1, self._client)

    def part(self, collider: int, body: int, link: int) -> None:
        """Stop a collider from touching a body or link."""
        for part in range(-1, pb.getNumJoints(collider, self._client)):
            pb.setCollisionFilterPair(collider, body, part, link, 0, self._client)

    def retire(self, collider: int) -> None:
        """Reset a collider's rules before the collider is removed, so that a body that gets its id touches other bodies
        normally, and no collider."""
        self._colliders.discard(collider)
        self._reset(collider)

    def _reset(self, uid: int) -> None:
        """Let a body or collider touch whatever it had a rule with, unless one of the two is a collider."""
        for link, other, other_link in self._rules.get(uid, ()):
            touch = int(self._colliders.isdisjoint((uid, other)))
            pb.setCollisionFilterPair(uid, other, link, other_link, touch, self._client)
