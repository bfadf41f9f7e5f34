"""Notices sleeping bodies that moved, because their user moved them through PyBullet, or PyBullet woke them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import IntArray

# Largest motion of a sleeping body that is rounding [m].
ROUNDING = 1e-6


class SleepWatch:
    """Reads the sleeping bodies of one client in turn. Followers are addressed by slot."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self._calls = BulletCalls(client)
        self._followers = followers
        self._next = 0  # place in the sleeping bodies of the next one to read
        self._fresh: IntArray = np.empty(0, np.int64)

    def note(self, slots: IntArray) -> None:
        """Note bodies that fell asleep; all are read in the next update."""
        self._fresh = slots

    def moved(self, duration: float, period: float) -> IntArray:
        """Return the slots of those that are not where they fell asleep, among the bodies that fell asleep in the last
        update, and as many others as are due in a ``duration`` [s] if each is read once in a ``period`` [s]."""
        asleep = self._followers.asleep
        if not asleep.size:
            return asleep
        count = min(math.ceil(len(asleep) * duration / period), len(asleep))
        due = asleep[np.arange(self._next, self._next + count) % len(asleep)]
        self._next = (self._next + count) % len(asleep)
        chosen = np.concatenate([np.intersect1d(self._fresh, asleep), due])
        self._fresh = chosen[:0]
        return np.array([slot for slot in chosen.tolist() if self._moved(slot)], np.int64)

    def _moved(self, slot: int) -> bool:
        follower, known = self._followers[slot], self._followers.states[slot]
        body, link = follower.body, follower.link
        found = self._calls.states([body]) if link < 0 else self._calls.link_states(body, [link])
        return not CORE.strayed(found[0], known, follower.radius) <= ROUNDING  # True for NaN
