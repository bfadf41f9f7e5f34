"""Reads poses and velocities of attached bodies from PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from smartmesh_ros.physics.bullet import BulletCalls
from smartmesh_ros.physics.follower import Follower
from smartmesh_ros.terrain.grid import FloatArray


class FollowerReader:
    """Reads the base of each body with two PyBullet calls, and links with a call each."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._calls = BulletCalls(client)
        self.adopt([])

    def adopt(self, followers: list[Follower]) -> None:
        """Replace the list of attached bodies to read."""
        self._bodies = [follower.body for follower in followers]
        self._links = [(index, f.body, f.link) for index, f in enumerate(followers) if f.link >= 0]

    def positions(self) -> FloatArray:
        """Centres of mass (N, 3) [m]."""
        positions = np.array(self._calls.positions(self._bodies), np.float64).reshape(-1, 3)
        for index, body, link in self._links:
            positions[index] = self._client.getLinkState(body, link)[0]
        return positions

    def states(self) -> FloatArray:
        """Position, orientation (x, y, z, w), velocity and angular velocity (N, 13) [m, m/s, rad/s]."""
        states = self._calls.states(self._bodies)
        for index, body, link in self._links:
            state = self._client.getLinkState(body, link, computeLinkVelocity=1)
            states[index] = (*state[0], *state[1], *state[6], *state[7])
        return states
