"""Reads poses and velocities of attached bodies from PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.followers import Followers
from smartmesh_ros.terrain.grid import FloatArray, IntArray


class FollowerReader:
    """Reads each awake base with two PyBullet calls, and all awake links of a robot with one."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self._calls = BulletCalls(client)
        self._followers = followers
        self._wakes = -1

    def read_positions(self) -> FloatArray:
        """Return the centres of mass of the awake followers (n, 3) [m], in the order of `Followers.awake`."""
        self._list_awake()
        positions = np.empty((self._count, 3))
        positions[self._base_places] = np.array(self._calls.positions(self._bases), np.float64).reshape(-1, 3)
        for body, links, places in self._robots:
            positions[places] = self._calls.link_positions(body, links)
        return positions

    def read_states(self) -> FloatArray:
        """Return position, orientation (x, y, z, w), velocity and angular velocity of the awake followers (n, 13) [m,
        m/s, rad/s]."""
        self._list_awake()
        states = np.empty((self._count, 13))
        states[self._base_places] = self._calls.states(self._bases)
        for body, links, places in self._robots:
            states[places] = self._calls.link_states(body, links)
        return states

    def _list_awake(self) -> None:
        if self._wakes == self._followers.wakes:
            return
        self._wakes = self._followers.wakes
        awake = [self._followers[slot] for slot in self._followers.awake.tolist()]
        self._count = len(awake)
        self._bases = [follower.body for follower in awake if follower.link < 0]
        self._base_places = np.array([place for place, follower in enumerate(awake) if follower.link < 0], np.int64)
        by_robot: dict[int, list[int]] = {}
        for place, follower in enumerate(awake):
            if follower.link >= 0:
                by_robot.setdefault(follower.body, []).append(place)
        self._robots: list[tuple[int, list[int], IntArray]] = [
            (body, [awake[place].link for place in places], np.array(places)) for body, places in by_robot.items()
        ]
