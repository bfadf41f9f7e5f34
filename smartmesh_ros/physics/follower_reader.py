"""Reads poses and velocities of attached bodies from PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.followers import Followers
from smartmesh_ros.terrain.grid import FloatArray


class FollowerReader:
    """Reads the base of each awake body with two PyBullet calls, and links with a call each."""

    def __init__(self, client: Any, followers: Followers) -> None:
        self._client = client
        self._calls = BulletCalls(client)
        self._followers = followers
        self._wakes = -1

    def read_positions(self) -> FloatArray:
        """Return the centres of mass of the awake followers (n, 3) [m], in the order of `Followers.awake`."""
        self._list_awake()
        positions = np.array(self._calls.positions(self._bodies), np.float64).reshape(-1, 3)
        for place, body, link in self._links:
            positions[place] = self._client.getLinkState(body, link)[0]
        return positions

    def read_states(self) -> FloatArray:
        """Return position, orientation (x, y, z, w), velocity and angular velocity of the awake followers (n, 13) [m,
        m/s, rad/s]."""
        self._list_awake()
        states = self._calls.states(self._bodies)
        for place, body, link in self._links:
            state = self._client.getLinkState(body, link, computeLinkVelocity=1)
            states[place] = (*state[0], *state[1], *state[6], *state[7])
        return states

    def _list_awake(self) -> None:
        if self._wakes != self._followers.wakes:
            self._wakes = self._followers.wakes
            awake = [self._followers[slot] for slot in self._followers.awake.tolist()]
            self._bodies = [follower.body for follower in awake]
            self._links = [(place, f.body, f.link) for place, f in enumerate(awake) if f.link >= 0]
