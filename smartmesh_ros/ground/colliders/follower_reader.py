"""Reads poses and velocities of attached bodies from PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.followers import Followers
from smartmesh_ros.terrain.grid import FloatArray


class FollowerReader:
    """Reads each awake base with two PyBullet calls, and all awake links of a robot with one, into the tables of
    `Followers`."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self._calls = BulletCalls(client)
        self._followers = followers
        self._wakes = -1

    def read_positions(self, dt: float) -> None:
        """Update ``positions_w`` and ``moved_w`` of the awake followers after a step of ``dt`` [s]."""
        self._take(dt, np.empty_like(self._followers.states))

    def read_states(self, dt: float) -> None:
        """Update ``states`` of the awake followers, and what `read_positions` does."""
        self._take(dt, self._followers.states)

    def _take(self, dt: float, states: FloatArray) -> None:
        self._list_awake()
        calls, followers, slots = self._calls, self._followers, self._slots
        parts = [calls.states(self._bases), *(calls.link_states(body, links) for body, links in self._robots)]
        states[slots] = found = np.concatenate(parts)
        followers.note_places(slots, found, dt)

    def _list_awake(self) -> None:
        """List the awake followers in the order in which they are read: bases, then the links of each robot."""
        if self._wakes == self._followers.wakes:
            return
        self._wakes = self._followers.wakes
        awake = [self._followers[slot] for slot in self._followers.awake.tolist()]
        bases = [follower for follower in awake if follower.link < 0]
        links = sorted((follower for follower in awake if follower.link >= 0), key=lambda follower: follower.body)
        by_robot: dict[int, list[int]] = {}
        for follower in links:
            by_robot.setdefault(follower.body, []).append(follower.link)
        self._bases = [follower.body for follower in bases]
        self._robots = list(by_robot.items())
        self._slots = np.array([follower.slot for follower in bases + links], np.int64)
