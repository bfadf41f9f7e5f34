"""Reads poses and velocities of attached bodies from PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.core import CORE
from smartmesh_ros.ground.bullet import BulletCalls
from smartmesh_ros.ground.followers import Followers


class FollowerReader:
    """Reads each awake base with two PyBullet calls, and all awake links of a robot with one, into the tables of
    `Followers`."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self._calls = BulletCalls(client)
        self._followers = followers
        self._wakes = -1

    def read_positions(self) -> None:
        """Update ``positions_w`` and ``moved_w`` of the awake followers after a step."""
        self._list_awake()
        calls, followers = self._calls, self._followers
        parts = [calls.positions(self._bases), *(calls.link_positions(body, links) for body, links in self._robots)]
        CORE.write_positions(self._slots, np.concatenate(parts), followers.positions_w, followers.moved_w)

    def read_states(self, dt: float) -> None:
        """Update ``states`` and ``positions_w`` of the awake followers, and ``moved_w`` by their velocities and the
        time step ``dt`` [s]."""
        self._list_awake()
        calls, followers = self._calls, self._followers
        parts = [calls.states(self._bases), *(calls.link_states(body, links) for body, links in self._robots)]
        found = np.concatenate(parts)
        CORE.write_states(self._slots, found, dt, followers.states, followers.positions_w, followers.moved_w)

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
